"use strict";
// The page of `vdet draw`: the counting rule, numbers for the panel, the file, then drawing and editing. Points are
// [x, y] in pixels of the frame. Rows of a path from `seen` on are where the vehicle would have driven on.

// ---------------------------------------------------------------- the rule, as vdet.traffic has it
const SETTLED = 0.1; // seconds after which a vehicle off the band has changed the side
const BAND = 0.05; // of the height of its box
const MIN_BAND = 0.003; // of the frame's height
const AT_EDGE = 0.002; // of the frame's side: points so near to the edge lie on it
const MAX_AT_EDGE = 0.005;
const INSIDE = 0.01; // pixels
const MOVED = 0.5; // of the largest size of its box: a vehicle that moved less stood the whole time
const STRIDE = 16; // rows of a path that have one box

const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const segmentsOf = corners => corners.map((corner, i) => [corners.at(i - 1), corner]);

/** Return where the way from a to b meets the segment from c to d, from 0 to 1, or null. */
function meeting([ax, ay], [bx, by], [[cx, cy], [dx, dy]]) {
  const ux = bx - ax, uy = by - ay, vx = dx - cx, vy = dy - cy;
  const area = ux * vy - uy * vx;
  if (area === 0) return null;
  const along = ((cx - ax) * vy - (cy - ay) * vx) / area;
  const across = ((cx - ax) * uy - (cy - ay) * ux) / area;
  return along >= 0 && along <= 1 && across >= 0 && across <= 1 ? along : null;
}

/** Return a side of a polygon, or a line, as numbers: its ends, the way from one to the other, and its box. */
function edgeOf([[ax, ay], [bx, by]]) {
  const [left, top, right, bottom] = boundsOf([[ax, ay], [bx, by]]), wx = bx - ax, wy = by - ay;
  return { ax, ay, by, wx, wy, slope: wx / wy, square: wx * wx + wy * wy, left, top, right, bottom };
}

function distanceTo(side, x, y) {
  const at = clamp(((x - side.ax) * side.wx + (y - side.ay) * side.wy) / side.square, 0, 1);
  const dx = x - side.ax - at * side.wx, dy = y - side.ay - at * side.wy;
  return Math.sqrt(dx * dx + dy * dy); // Math.hypot is ten times as slow
}

/** Return the smallest box around points: [left, top, right, bottom]. */
function boundsOf(points) {
  const xs = points.map(point => point[0]), ys = points.map(point => point[1]);
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
}

function snapped(point, size) {
  return point.map((value, i) => {
    const near = Math.max(Math.min(1, MAX_AT_EDGE * size[i]), AT_EDGE * size[i]);
    return value <= near ? 0 : size[i] - value <= near ? size[i] : value;
  });
}

/** Place a line, whose positive side is its left; at the frame's edge it goes on beyond. */
function placeLine(line, size) {
  const [start, end] = [snapped(line.start, size), snapped(line.end, size)];
  const [ax, ay] = end, wx = start[0] - ax, wy = start[1] - ay, length = Math.hypot(wx, wy);
  const dx = -wx * (size[0] + size[1]) / length, dy = -wy * (size[0] + size[1]) / length;
  const atEdge = point => point.some((value, i) => value === 0 || value === size[i]);
  const reach = [atEdge(start) ? [start[0] - dx, start[1] - dy] : start, atEdge(end) ? [ax + dx, ay + dy] : end];
  const distance = (x, y) => (wx * (y - ay) - wy * (x - ax)) / length;
  return {
    isZone: false, name: line.name, hasFlows: line.flows !== false,
    directions: [line.left, line.right], start, end, length, size, edge: edgeOf([start, end]),
    isPositive: (x, y) => distance(x, y) >= 0,
    away: (x, y) => Math.abs(distance(x, y)),
    cuts: ([left, top, right, bottom]) => Math.abs(distance((left + right) / 2, (top + bottom) / 2)) <=
      INSIDE + (Math.abs(wx) * (bottom - top) + Math.abs(wy) * (right - left)) / (2 * length),
    meeting(a, b) { // from the distances that also give the side, so that none is lost by rounding
      const before = distance(...a), along = before / (before - distance(...b)), [[cx, cy], [dx, dy]] = reach;
      const x = a[0] + along * (b[0] - a[0]) - cx, y = a[1] + along * (b[1] - a[1]) - cy;
      const across = (x * (dx - cx) + y * (dy - cy)) / ((dx - cx) ** 2 + (dy - cy) ** 2);
      return across >= 0 && across <= 1 ? along : null;
    },
  };
}

/** Place a zone, whose positive side is the inside; at the frame's edge it goes on beyond. */
function placeZone(zone, size) {
  const corners = zone.points.map(point => snapped(point, size));
  const isAtEdge = ([a, b], i) => a[i] === b[i] && (a[i] === 0 || a[i] === size[i]);
  const segments = segmentsOf(corners).filter(segment => !isAtEdge(segment, 0) && !isAtEdge(segment, 1));
  const [right, bottom] = size.map(side => side - INSIDE), sides = segments.map(edgeOf);
  const inFrame = ([x, y]) => [clamp(x, INSIDE, right), clamp(y, INSIDE, bottom)];
  return {
    isZone: true, name: zone.name, hasFlows: zone.flows !== false,
    directions: ["enter", "exit", "appear", "vanish"], corners, size,
    ...polygonOf(corners, INSIDE, right, bottom),
    away: (x, y) => sides.reduce((least, side) =>
      Math.min(least, distanceTo(side, clamp(x, INSIDE, right), clamp(y, INSIDE, bottom))), Infinity),
    meeting(a, b) {
      const met = segments.map(segment => meeting(inFrame(a), inFrame(b), segment)).filter(fraction => fraction !== null);
      return met.length ? Math.max(...met) : 1;
    },
  };
}

/** Return what tells which points lie in a polygon, and which boxes its sides cut; those outside the frame are moved in. */
function polygonOf(corners, low, right, bottom) {
  const sides = segmentsOf(corners).map(edgeOf);
  return {
    isPositive(x, y) {
      x = clamp(x, low, right);
      y = clamp(y, low, bottom);
      let inside = false;
      for (const side of sides) {
        if ((side.ay > y) !== (side.by > y) && x < side.ax + (y - side.ay) * side.slope) inside = !inside;
        if (x >= side.left && x <= side.right && y >= side.top && y <= side.bottom && distanceTo(side, x, y) === 0) return true;
      }
      return inside;
    },
    cuts(box) {
      const left = clamp(box[0], low, right), top = clamp(box[1], low, bottom);
      const width = clamp(box[2], low, right) - left, height = clamp(box[3], low, bottom) - top;
      return sides.some(side =>
        side.left <= left + width && side.right >= left && side.top <= top + height && side.bottom >= top &&
        2 * Math.abs(side.wx * (top + height / 2 - side.ay) - side.wy * (left + width / 2 - side.ax)) <=
        Math.abs(side.wx) * (height + INSIDE) + Math.abs(side.wy) * (width + INSIDE));
    },
  };
}

/** Add boxes to a path, each around STRIDE rows and the row after them: left, top, right, bottom. */
function withBoxes(path) {
  const boxes = [];
  for (let row = 0; row < path.xs.length - 1; row += STRIDE) {
    const xs = path.xs.slice(row, row + STRIDE + 1), ys = path.ys.slice(row, row + STRIDE + 1);
    boxes.push([Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)]);
  }
  return { ...path, boxes };
}

/** Return the rows of a path before which it changes the side of a border; most boxes tell that it cannot. */
function turnsOf({ xs, ys, boxes }, border) {
  const turns = [];
  for (let first = 0; first < xs.length - 1; first += STRIDE) {
    if (!border.cuts(boxes[first / STRIDE])) continue;
    let before = border.isPositive(xs[first], ys[first]);
    for (let row = first + 1; row <= first + STRIDE && row < xs.length; row++) {
      const side = border.isPositive(xs[row], ys[row]);
      if (side !== before) turns.push(row);
      before = side;
    }
  }
  return turns;
}

/** Return what a vehicle does at a border, in order: time, row, direction. */
function crossings(path, border) {
  const { times, xs, ys } = path, turns = turnsOf(path, border), begins = border.isPositive(xs[0], ys[0]), found = [];
  if (!turns.length && !(border.isZone && begins)) return found; // as for most paths
  let settled = null, crossed = null; // the side, and where it crossed last
  for (let i = 0; i <= turns.length; i++) {
    const row = turns[i - 1] ?? 0, end = turns[i] ?? times.length, side = begins === (i % 2 === 0);
    if (side === settled) continue;
    if (settled === null) {
      if (!settles(path, border, row, end, Infinity)) continue;
      if (side && border.isZone) found.push({ time: times[0], row: 0, direction: "appear" });
    } else {
      const a = [xs[row - 1], ys[row - 1]], b = [xs[row], ys[row]];
      const fraction = border.meeting(a, b), along = fraction ?? 1;
      const place = [a[0] + along * (b[0] - a[0]), a[1] + along * (b[1] - a[1])];
      const way = crossed ? Math.hypot(crossed[0] - place[0], crossed[1] - place[1]) : Infinity;
      if (!settles(path, border, row, end, way)) continue; // back, but not far
      crossed = fraction === null ? null : place;
      const time = times[row - 1] + along * (times[row] - times[row - 1]);
      if (fraction !== null) found.push({ time, row: fraction ? row : row - 1, direction: border.directions[side ? 0 : 1] });
    }
    settled = side;
  }
  const last = path.seen - 1;
  if (border.isZone && settled) // it may enter where it drives on
    found.push({ time: Math.max(times[last], found.at(-1).time), row: last, direction: "vanish" });
  return found;
}

/** Return whether rows on one side of a border settle it: one height of the box away, or after a long enough `way`. */
function settles({ times, xs, ys, heights }, border, first, end, way) {
  let since = 0, wasOff = false, wasFar = false;
  for (let row = first; row < end; row++) {
    const height = heights[row], away = border.away(xs[row], ys[row]);
    const isOff = away > Math.max(BAND * height, MIN_BAND * border.size[1]), isFar = isOff && away >= height;
    if (!isOff || !wasOff) since = times[row];
    const isLong = isOff && Math.round(1e4 * (times[row] - since)) / 1e4 >= SETTLED;
    const isSettled = wasFar || isLong || (isFar && row === times.length - 1);
    if (isSettled && (isFar || wasFar || height <= way)) return true;
    [wasOff, wasFar] = [isOff, isFar];
  }
  return false;
}

/** Return whether a vehicle moved while it was seen. */
function hasDriven({ xs, ys, seen, largest }) {
  return xs.some((x, row) => row < seen && Math.hypot(x - xs[0], ys[row] - ys[0]) >= MOVED * largest);
}

/** Return the parts of paths inside the regions; paths of which nothing is left are gone. */
function inRegions(paths, regions, [width, height]) {
  const polygons = regions.map(each =>
    ({ value: each.kind === "exclude" ? 0 : 1, ...polygonOf(each.points, 0, width - 1, height - 1) }));
  polygons.sort((a, b) => b.value - a.value); // what is excluded is so in any region
  const isOpen = polygons.every(polygon => !polygon.value);
  return paths.map(path => {
    const rows = new Uint8Array(path.xs.length).fill(isOpen);
    for (const polygon of polygons) {
      let from = 0, isInside = polygon.isPositive(path.xs[0], path.ys[0]);
      for (const end of [...turnsOf(path, polygon), rows.length]) {
        if (isInside) rows.fill(polygon.value, from, end);
        [from, isInside] = [end, !isInside];
      }
    }
    if (!rows.includes(0)) return path;
    if (path.rows && rows.every((value, row) => value === path.rows[row])) return path.part; // as before
    const kept = path.times.map((_, row) => row).filter(row => rows[row]), seen = kept.filter(row => row < path.seen).length;
    const [times, xs, ys, heights] = [path.times, path.xs, path.ys, path.heights].map(values => kept.map(row => values[row]));
    return Object.assign(path, { rows, part: seen && withBoxes({ ...path, part: null, seen, times, xs, ys, heights }) }).part;
  }).filter(path => path);
}

// ---------------------------------------------------------------- what follows from crossings
const NEAR = 0.5; // heights of the box within which a path that begins or ends is at a line
const FEW = 0.05; // fraction of the crossings up to which there is no warning
const CARS = 5, WIDTHS = [0.8, 5]; // number of cars for a median of their widths, and the widths that are possible, metres

/** Return the sentences of a run about a line; visits are [path, its crossings]. */
function warningsOf(line, visits, paths, span) {
  const crossed = new Set(visits.map(([path]) => path)), few = FEW * visits.length;
  const isMissed = path => !crossed.has(path) && [0, path.seen - 1].some(row =>
    path.times[row] > span[0] && path.times[row] < span[1] &&
    distanceTo(line.edge, path.xs[row], path.ys[row]) <= NEAR * path.heights[row]);
  const missed = paths.filter(isMissed).length, again = visits.filter(([, some]) => some.length > 1).length;
  const heights = visits.flatMap(([path, some]) => some.map(each => path.heights[each.row]));
  return [
    paths.length && !visits.length && "no vehicle crossed this line",
    missed > few && `tracks that begin or end at this line and are not counted: ${missed}; ` +
      "move it to where vehicles are tracked longer",
    again > few && `paths that cross this line more than once: ${again}; place it across the road`,
    heights.length && line.length < quantile(heights, 0.5) && "this line is shorter than a vehicle; make it longer",
  ].filter(text => text);
}

const LANE_ONLY = "ground: no speeds: the width of a lane alone does not give lengths along it; also give the metres of points 1 to 2";

/** Return a warning if cars cannot have the widths that the ground gives them: their boxes are 1.25 times as wide as high. */
function groundWarnings(ground, paths) {
  const widths = paths.filter(path => path.kind === "car").flatMap(path => {
    const row = path.seen >> 1, half = path.heights[row] / 1.6;
    const [left, right] = [-half, half].map(aside => ground?.toMetres([path.xs[row] + aside, path.ys[row]]));
    return left && right ? [Math.hypot(right[0] - left[0], right[1] - left[1])] : [];
  });
  if (widths.length < CARS) return [];
  const width = quantile(widths, 0.5);
  return width < WIDTHS[0] || width > WIDTHS[1] ? [`ground: cars are ${width.toFixed(1)} m wide by these points; check their metres`] : [];
}

function quantile(values, fraction) {
  const sorted = [...values].sort((a, b) => a - b), at = fraction * (sorted.length - 1), low = Math.floor(at);
  return sorted[low] + (at - low) * (sorted[Math.ceil(at)] - sorted[low]);
}

/** Return how many vehicles go from one place to another, by "from\nto"; to nothing for a single place. */
function flowsOf(found) {
  const trips = new Map(), flows = {};
  for (const { border: { name }, visits } of found.filter(({ border }) => border.hasFlows))
    for (const [path, some] of visits)
      for (const { direction, time, row } of some)
        if (direction !== "exit" && direction !== "vanish")
          trips.set(path, [...trips.get(path) ?? [], { name, time: Math.round(1000 * time), row }]);
  for (const trip of trips.values()) {
    trip.sort((a, b) => a.time - b.time || a.row - b.row || (a.name < b.name ? -1 : 1));
    const flow = `${trip[0].name}\n${trip.length > 1 ? trip.at(-1).name : ""}`;
    flows[flow] = (flows[flow] ?? 0) + 1;
  }
  return flows;
}

// ---------------------------------------------------------------- the road plane
/** Solve normal equations by Gaussian elimination; null where they have no solution. */
function solve(rows, values) {
  const size = rows.length, table = rows.map((row, i) => [...row, values[i]]);
  for (let column = 0; column < size; column++) {
    if (table[column][column] < 1e-12) return null;
    for (let row = 0; row < size; row++) {
      const factor = row === column ? 0 : table[row][column] / table[column][column];
      for (let at = column; factor && at <= size; at++) table[row][at] -= factor * table[column][at];
    }
  }
  return table.map((row, i) => row[size] / row[i]);
}

/** Move and scale points so that they lie around 0 at a distance of about 1. */
function normalized(points) {
  const middle = [0, 1].map(i => points.reduce((sum, point) => sum + point[i], 0) / points.length);
  const scale = Math.max(...points.map(point => Math.hypot(point[0] - middle[0], point[1] - middle[1]))) || 1;
  return { middle, scale, points: points.map(point => point.map((value, i) => (value - middle[i]) / scale)) };
}

/** Return the homography from some points to others (Hartley and Zisserman, ch. 4); null where they do not fix one. */
function homography(from, to) {
  const source = normalized(from), target = normalized(to);
  const equations = source.points.flatMap(([x, y], n) => {
    const [u, v] = target.points[n];
    return [[[x, y, 1, 0, 0, 0, -u * x, -u * y], u], [[0, 0, 0, x, y, 1, -v * x, -v * y], v]];
  });
  const sum = (i, j) => equations.reduce((total, [row, value]) => total + row[i] * (j < 8 ? row[j] : value), 0);
  const rows = Array.from({ length: 8 }, (_, i) => Array.from({ length: 8 }, (_, j) => sum(i, j)));
  const h = solve(rows, rows.map((_, i) => sum(i, 8)));
  const map = point => { // null for what would be behind the camera
    const [x, y] = point.map((value, i) => (value - source.middle[i]) / source.scale);
    const depth = h[6] * x + h[7] * y + 1;
    return depth > 1e-9 ? [0, 1].map(i => target.middle[i] +
      target.scale * (h[3 * i] * x + h[3 * i + 1] * y + h[3 * i + 2]) / depth) : null;
  };
  return h && from.every(map) ? map : null;
}

/** Fit the road plane to points; null where they do not fix one. */
function fitGround(points) {
  const pixels = points.map(each => each.pixel), metres = points.map(each => each.metres);
  const [toMetres, toPixels] = points.length < 4 ? [] : [homography(pixels, metres), homography(metres, pixels)];
  return toMetres && toPixels ? { toMetres, toPixels } : null;
}

/** Return the distance of the horizon from a camera, pixels; without a focal length, that is assumed to be the width. */
const toHorizon = (horizon, size, focal) => Math.hypot(focal ?? size[0], horizon - size[1] / 2);

/** Return the plane below a level camera in any unit: where a pixel lies, and how far aside a straight line goes for each
 * unit along, by the x of its vanishing point. `focal` is the distance of the horizon. */
function levelPlane(horizon, size, focal) {
  const middle = size[0] / 2;
  return {
    place: ([x, y]) => [(x - middle) / focal, 1].map(value => value / (y - horizon)),
    slopeOf: vanishing => (vanishing - middle) / focal,
  };
}

/** Return points of the plane in metres: `scale` is the number of metres of a unit. */
const scaledGround = (pixels, place, scale, by) =>
  pixels.map(pixel => ({ pixel, metres: place(pixel).map(value => value * scale), by }));

/** Return points of the plane from the width of a straight lane: two points on its left line, and two on its right, near
 * and far; null where they do not fit. Lengths along the lane follow from the focal length, in pixels, or from the metres
 * between the first two points, which give it; without both, they are a guess, and the points say so. */
function groundOfLane(pixels, laneWidth, size, focal, length) {
  const [[x1, y1], [x2, y2], [x3, y3], [x4, y4]] = pixels, a = x1 * y2 - y1 * x2, b = x3 * y4 - y3 * x4;
  const parallel = (x1 - x2) * (y3 - y4) - (y1 - y2) * (x3 - x4);
  const [vanishing, horizon] = [a * (x3 - x4) - (x1 - x2) * b, a * (y3 - y4) - (y1 - y2) * b].map(value => value / parallel);
  if (!(laneWidth > 0 && y1 > y2 && y3 > y4 && horizon < Math.min(y2, y4))) return null;
  const aside = vanishing - size[0] / 2, widths = [pixels[0], pixels[2]].map(([x, y]) => (x - vanishing) / (y - horizon));
  const ratio = length * Math.abs(widths[1] - widths[0]) / laneWidth / (1 / (y2 - horizon) - 1 / (y1 - horizon));
  const distance = length ? (ratio + Math.sqrt(ratio ** 2 - 4 * aside ** 2)) / 2 : toHorizon(horizon, size, focal);
  if (!distance) return null;
  const { place, slopeOf } = levelPlane(horizon, size, distance), slope = slopeOf(vanishing);
  const [left, right] = [pixels[0], pixels[2]].map(place).map(([across, along]) => across - slope * along);
  return scaledGround(pixels, place, laneWidth * Math.hypot(1, slope) / Math.abs(right - left), focal || length ? undefined : "lane");
}

/** Return points of the plane from two lengths along a straight lane, each from near to far; null where they do not
 * fit. The lengths do not depend on the focal length. */
function levelGround(pixels, lengths, size) {
  const [y1, y2, y3, y4] = pixels.map(pixel => pixel[1]);
  const ratio = lengths[0] * (y3 - y4) / (lengths[1] * (y1 - y2)); // (y3 - h)(y4 - h) / (y1 - h)(y2 - h), h the horizon
  const [a, b, c] = [1 - ratio, ratio * (y1 + y2) - y3 - y4, y3 * y4 - ratio * y1 * y2];
  const horizon = (-b - Math.sqrt(b * b - 4 * a * c)) / (2 * a);
  if (!(y1 > y2 && y2 >= y3 && y3 > y4 && ratio > 0 && horizon < y4)) return null;
  const [near, , , far] = pixels, { place, slopeOf } = levelPlane(horizon, size, toHorizon(horizon, size));
  const slope = slopeOf(near[0] + (far[0] - near[0]) * (horizon - near[1]) / (far[1] - near[1]));
  const scale = lengths[0] / Math.hypot(1, slope) / (1 / (y2 - horizon) - 1 / (y1 - horizon));
  const aside = (near[0] < size[0] / 2 ? size[0] : -size[0]) / 4 / (y1 - horizon);
  const corners = [near, far].flatMap(([x, y]) => [[x, y], [x + aside * (y - horizon), y]]);
  return scaledGround(corners, place, scale);
}

// ---------------------------------------------------------------- the file
const MARK = "# Drawn with vdet draw";
const FORMS = { // the lists of the file, and what their items have
  ground: ["pixel", "metres", "by"], regions: ["name", "kind", "points", "mask"],
  lines: ["name", "start", "end", "left", "right", "approach", "flows"], zones: ["name", "points", "flows"],
};

/** Remove the last corner of a polygon where it repeats the first one. */
function withoutRepeated(item) {
  const { points } = item, isClosed = points?.length > 3 && String(points[0]) === String(points.at(-1));
  return isClosed ? { ...item, points: points.slice(0, -1) } : item;
}

/** Write the settings of the camera as YAML; `rest` has the lines of everything else. */
function writeYaml(places, size, rest, name) {
  const write = value => Array.isArray(value) ? `[${value.map(write).join(", ")}]` :
    typeof value === "number" ? String(Math.round(1000 * value) / 1000) : escaped(JSON.stringify(value));
  const line = (kind, item) => FORMS[kind].filter(key => item[key] != null)
    .map(key => `${key}: ${key === "kind" ? item.kind : write(item[key])}`).join(", ");
  const list = (kind, indent, note) => places[kind].length ? [`${indent}${kind}:  # ${note}`,
    ...places[kind].map(item => `${indent}  - {${line(kind, item)}}`)] : [];
  const traffic = [
    ...list("lines", "  ", "left and right are seen from start to end"),
    ...list("zones", "  ", "polygons in which vehicles are counted"), ...rest.traffic];
  return [
    `${MARK}: this file says where the vehicles of a camera are counted.`,
    escaped(`# vdet detect-video CLIP --no-video -c ${name} --flows flows.csv --interval 15min`),
    "camera:", `  size: ${write(size)}  # points below are pixels of such frames`,
    ...list("ground", "  ", "points of the road in pixels and metres"), ...rest.camera,
    ...list("regions", "", "parts of the frame in which vehicles are shown"),
    ...(traffic.length ? ["traffic:", ...traffic] : []), ...rest.other, "",
  ].join("\n");
}

/** Read a file that `writeYaml` has written: size, places and rest. Raises an Error for others. */
function readYaml(text) {
  if (!text.startsWith(MARK)) throw Error("not written by this page; open it with vdet draw CLIP -c FILE");
  const places = { ground: [], regions: [], lines: [], zones: [] }, rest = { camera: [], traffic: [], other: [] };
  const quoted = part => /^("|true$|false$)/.test(part) ? part : JSON.stringify(part); // items are JSON, but for plain words
  const readItem = item => JSON.parse(item.replace(/"(?:\\.|[^"\\])*"|[A-Za-z_]\w*/g, quoted));
  let section = "other", list = null, size = null;
  for (const line of text.split("\n").filter(line => line.trim() && !line.startsWith("#"))) {
    const [, indent, key] = /^( *)(\w+):/.exec(line) ?? [], item = /^ *- (\{.*\})$/.exec(line);
    if (indent === "") section = key in rest ? key : "other";
    if (FORMS[key] && indent === (key === "regions" ? "" : "  ")) list = key;
    else if (list && item) places[list].push(withoutRepeated(readItem(item[1])));
    else if (list && /^ *-/.test(line)) throw Error(`not as this page writes it: ${line.trim()}`);
    else {
      list = null;
      if (section === "camera" && key === "size" && indent === "  ") size = JSON.parse(/\[.*?\]/.exec(line)[0]);
      else if (indent !== "" || section === "other") rest[section].push(line);
    }
  }
  if (!size) throw Error("has no camera.size");
  return { size, places, rest };
}

/** Return what is wrong with places, in sentences; a run would refuse them. */
function problemsOf({ lines, zones, regions, ground }, size) {
  const isTwice = (each, i, all) => all.findIndex(other => other.name === each.name) < i;
  const isShort = ({ start, end }) => [0, 1].every(i => Math.abs(start[i] - end[i]) < 0.01 * size[i]);
  const say = (some, text) => some.map(each => `${each.name}: ${text}`);
  return [
    ...say([...lines, ...zones].filter(isTwice), "the name is used twice"),
    ...say(regions.filter(isTwice), "the name is used twice"),
    ...say([...lines, ...zones].filter(each => each.name === "(none)"), "choose another name"),
    ...say(lines.filter(isShort), "is shorter than 1 % of the frame"),
    ...say(lines.filter(line => line.left === line.right), "both sides have the same name"),
    ...say([...zones, ...regions].filter(each => each.points && crossesItself(each.points)), "crosses or touches itself"),
    ...(ground.length && ground.length < 4 ? ["ground: needs at least four points with their metres"] :
      ground.length && !fitGround(ground) ? ["ground: these points do not fix a plane; check their metres"] : []),
  ];
}

function crossesItself(corners) {
  const sides = segmentsOf(corners);
  return sides.some((side, i) => sides.some((other, j) =>
    j > i + 1 && !(i === 0 && j === sides.length - 1) && meeting(...side, other) !== null));
}

// ---------------------------------------------------------------- the linked paths
/** Return the paths that Python packs: four rows of the changes of numbers, deflated. */
async function readPaths(packed) {
  const bytes = Uint8Array.from(atob(packed.data), char => char.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const numbers = new Int32Array(await new Response(stream).arrayBuffer()), count = numbers.length / 4;
  let first = 0;
  return packed.vehicles.map(([vehicle, kind, largest, start, seen, length]) => {
    const [times, xs, ys, heights] = [0, 1, 2, 3].map(row => {
      let value = 0;
      return Array.from({ length }, (_, at) => value += numbers[row * count + first + at]);
    });
    first += length;
    return withBoxes({ vehicle, kind, largest, seen, heights, times: times.map(time => Math.round(1e6 * start + time) / 1e6),
      xs: xs.map(x => x / 100), ys: ys.map(y => y / 100) });
  });
}

// ---------------------------------------------------------------- the page
const KINDS = { lines: "line", zones: "zone", regions: "region", ground: "point" };
const SHAPES = ["g", "line", "polygon", "polyline", "circle", "text", "tspan"];
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const get = id => document.getElementById(id);
const metresOf = point => `${point.metres.map(value => Math.round(100 * value) / 100).join(", ")} m`;

/** Make an element; texts are never read as HTML. */
function el(tag, attributes = {}, ...children) {
  const space = `http://www.w3.org/${SHAPES.includes(tag) ? "2000/svg" : "1999/xhtml"}`;
  const made = document.createElementNS(space, tag);
  for (const [name, value] of Object.entries(attributes))
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else made.setAttribute(name, value);
  made.append(...children);
  return made;
}

async function openPage(data) {
  const { size } = data, [width, height] = size;
  const stage = get("stage"), view = get("view"), marks = get("marks"), lens = get("lens");
  const every = await readPaths(data.paths), hasClasses = new Set(every.map(path => path.kind)).size > 1;
  const image = Object.assign(new Image(), { src: data.picture });
  await image.decode();
  data.places.lines = data.places.lines.map(line => ({ left: "left", right: "right", ...line }));
  for (const kind of ["zones", "regions"]) data.places[kind] = data.places[kind].map(withoutRepeated);

  let { places, rest } = data, past = [], future = [], saved = JSON.stringify(places);
  let tool = "select", selected = null; // what is selected: kind, index, and the number of a point
  let drawn = [], pointer = null, drag = null, hovered = null;
  let paths = every, found = []; // those inside the regions that drive, and what they do at each line and zone
  let known = new Map(); // what was last found, by geometry

  const unit = () => width / Math.max(1, stage.clientWidth); // pixels of the frame in one of the screen
  const item = () => selected && places[selected.kind][selected.index];
  const buttons = [...document.querySelectorAll("[data-tool]")];
  const hint = () => buttons.find(button => button.dataset.tool === tool).dataset.hint;
  const say = text => { get("hint").textContent = text; };
  const inside = point => point.map((value, i) => Math.round(10 * clamp(value, 0, size[i])) / 10);
  const add = (kind, made) => change(() => { selected = { kind, index: places[kind].push(made) - 1, point: null }; });
  const swap = () => item()?.start && change(() => Object.assign(item(), { left: item().right, right: item().left }));

  const segment = ([[x1, y1], [x2, y2]]) => ["grip", "drawn"].map(name => el("line", { x1, y1, x2, y2, class: name }));
  const dot = ([cx, cy], r, name, more = {}) => el("circle", { cx, cy, r: r * unit(), class: name, ...more });

  // ------------------------------------------------ changes, with their history
  function change(action) {
    past.push(JSON.stringify(places));
    future = [];
    action();
    refresh();
  }

  function travel(from, to) {
    if (!from.length) return;
    to.push(JSON.stringify(places));
    [places, selected, drawn] = [JSON.parse(from.pop()), null, []];
    refresh();
  }

  function freeName(stem) {
    const names = [...places.lines, ...places.zones, ...places.regions].map(each => each.name);
    for (let number = 1; ; number++) if (!names.includes(`${stem} ${number}`)) return `${stem} ${number}`;
  }

  /** Delete the selected corner of a polygon, else the whole. */
  function remove() {
    const points = item()?.points, { kind, index, point } = selected ?? {};
    if (points?.length > 3 && point !== null) change(() => { points.splice(point, 1); selected.point = null; });
    else if (selected) change(() => { places[kind].splice(index, 1); selected = null; });
  }

  /** Return the points of an item as they are shown; those of the ground are middles of pixels. */
  function pointsOf(kind, each) {
    if (kind === "lines") return [each.start, each.end];
    return kind === "ground" ? [each.pixel.map(value => value + 0.5)] : each.points ?? [];
  }

  function move(dx, dy) {
    const each = item(), { kind, point } = selected;
    pointsOf(kind, each).forEach(([x, y], number) => {
      if (point !== null && point !== number) return;
      const moved = inside([x + dx, y + dy]);
      if (kind === "lines") each[number ? "end" : "start"] = moved;
      else if (kind === "ground") each.pixel = moved.map(value => value - 0.5);
      else each.points[number] = moved;
    });
  }

  // ------------------------------------------------ counts
  function recount() {
    const regions = places.regions.filter(each => each.points), before = known;
    known = new Map(); // only what has changed is counted again
    const area = JSON.stringify(regions.map(each => [each.kind, each.points]));
    paths = known.set(area, before.get(area) ?? inRegions(every, regions, size).filter(hasDriven)).get(area);
    found = [...places.lines.map(each => placeLine(each, size)), ...places.zones.map(each => placeZone(each, size))]
      .map(border => {
        const key = JSON.stringify([border.start, border.end, border.corners, border.directions]), last = before.get(key);
        known.set(key, new Map(paths.map(path => [path, last?.get(path) ?? crossings(path, border)])));
        return { border, visits: [...known.get(key)].filter(([, some]) => some.length) };
      });
  }

  /** Return how many vehicles go in a direction, and as text how many of each class. */
  function countOf({ visits }, direction) {
    const counts = new Map();
    for (const [{ kind }, some] of visits)
      for (const each of some) if (each.direction === direction) counts.set(kind, (counts.get(kind) ?? 0) + 1);
    const kinds = [...counts].sort(([, a], [, b]) => b - a), total = kinds.reduce((sum, [, count]) => sum + count, 0);
    return { total, classes: hasClasses ? kinds.map(([kind, count]) => `${count} ${kind}`).join(", ") : "" };
  }

  // ------------------------------------------------ what is drawn
  function paintPaths() {
    const context = view.getContext("2d"), scale = unit();
    [view.width, view.height] = size;
    context.drawImage(image, 0, 0, width, height);
    context.lineWidth = Math.max(1.5, 1.5 * scale);
    context.globalAlpha = clamp(8 / Math.sqrt(every.length), 0.2, 0.8);
    for (const { xs, ys, seen } of get("paths").checked ? every : []) {
      const turn = Math.atan2(ys[seen - 1] - ys[0], xs[seen - 1] - xs[0]) * 180 / Math.PI;
      context.strokeStyle = `hsl(${Math.round(turn + 360) % 360} 90% 58%)`;
      context.beginPath();
      for (let row = 0, last = 0; row < seen; row++) {
        if (row && row < seen - 1 && Math.abs(xs[row] - xs[last]) + Math.abs(ys[row] - ys[last]) < 2 * scale) continue;
        context.lineTo(xs[row], ys[row]);
        last = row;
      }
      context.stroke();
    }
  }

  function label([x, y], lines, anchor = "middle", name = "") {
    const letter = (stage.clientWidth < 600 ? 10 : 13) * unit(), [left, right] = [0.06 * width, 0.94 * width];
    return el("text", { x, y, "font-size": letter, "text-anchor": x < left ? "start" : x > right ? "end" : anchor, class: name },
      ...lines.filter(line => line).map((line, i) => el("tspan", { x, dy: i ? 1.15 * letter : 0 }, line)));
  }

  function drawMarks() {
    const ground = fitGround(places.ground);
    marks.replaceChildren(...(ground ? gridOf(ground) : []));
    for (const kind of ["regions", "zones", "lines", "ground"])
      marks.append(...places[kind].map((each, index) => drawItem(kind, each, index)));
    if (hovered)
      marks.append(el("polyline", { class: "hovered", points: Array.from({ length: hovered.seen },
        (_, row) => `${hovered.xs[row]},${hovered.ys[row]}`).join(" ") }));
    const shown = pointer && tool !== "select" ? [...drawn, pointer] : drawn, isOpen = tool === "lengths";
    marks.append(isOpen ? "" : el("polyline", { points: shown.join(" "), class: "new" }), ...shown.map(each => dot(each, 5, "new")),
      ...(isOpen ? drawn.map(([x, y], index) => label([x, y - 11 * unit()], [String(index + 1)])) : []));
  }

  function drawItem(kind, each, index) {
    const isSelected = selected?.kind === kind && selected.index === index, points = pointsOf(kind, each);
    if (!points.length) return ""; // a mask
    const name = `${kind === "regions" ? each.kind ?? "include" : kind}${isSelected ? " selected" : ""}`;
    const group = el("g", { class: name, "data-kind": kind, "data-index": index });
    if (kind === "lines") {
      const [start, end] = points, length = Math.hypot(end[0] - start[0], end[1] - start[1]) || 1;
      const left = [(end[1] - start[1]) / length, (start[0] - end[0]) / length];
      const at = fraction => start.map((value, i) => value + fraction * (end[i] - value));
      group.append(...segment(points), ...sideOf(each.left, left, at(0.03), index),
        ...sideOf(each.right, left.map(value => -value), at(0.97), index),
        label([at(0.5)[0], at(0.5)[1] - 9 * unit()], [each.name]));
    } else if (kind === "ground") {
      group.append(label([points[0][0], points[0][1] - 11 * unit()], [`${index + 1}: ${metresOf(each)}`]));
    } else {
      const top = points.reduce((best, point) => point[1] < best[1] ? point : best);
      const count = way => countOf(found[places.lines.length + index], way).total;
      const counts = kind === "zones" ? `in ${count("enter") + count("appear")}, out ${count("exit") + count("vanish")}` : "";
      group.append(el("polygon", { points: points.join(" ") }), label([top[0], top[1] + 18 * unit()], [each.name, counts]));
    }
    if (isSelected || kind === "ground")
      group.append(...points.flatMap((point, number) => [dot(point, 15, "grip", { "data-point": number }),
        dot(point, isSelected && selected.point === number ? 8 : 6, "handle")]));
    return group;
  }

  /** Return the arrow to a side of a line, with what goes there; `way` has length 1. */
  function sideOf(name, way, from, index) {
    const { total } = countOf(found[index], name), tip = from.map((value, i) => value + 26 * unit() * way[i]);
    const wing = sign => tip.map((value, i) => value - 7 * unit() * (way[i] + (i ? sign : -sign) * way[1 - i] / 2));
    const down = way[1] > 0.3 ? 16 : way[1] > -0.3 ? 4 : -7;
    const at = [tip[0] + 10 * unit() * way[0], clamp(tip[1] + down * unit(), 14 * unit(), height - 4 * unit())];
    const anchor = way[0] > 0.5 ? "start" : way[0] < -0.5 ? "end" : "middle";
    return [el("polyline", { points: [from, tip, wing(1), tip, wing(-1)].join(" ") }),
      label(at, [`${name} ${total}`], anchor, "count")];
  }

  function gridOf(ground) {
    const [left, low, right, high] = boundsOf(places.ground.map(each => each.metres));
    const step = [1, 2, 5, 10, 20, 50, 100].find(each => Math.max(right - left, high - low) / each <= 14) ?? 200;
    const lines = (from, to, at) => Array.from({ length: 1 + Math.floor(to / step) - Math.ceil(from / step) }, (_, n) => {
      const value = (Math.ceil(from / step) + n) * step;
      const points = Array.from({ length: 25 }, (_, i) => ground.toPixels(at(value, i / 24))).filter(point => point);
      return [el("polyline", { points: points.join(" "), class: "grid" }),
        label(points[0] ?? [0, 0], [points.length && `${value} m`], "middle", "grid")];
    }).flat();
    return [...lines(left, right, (x, fraction) => [x, low + fraction * (high - low)]),
      ...lines(low, high, (y, fraction) => [left + fraction * (right - left), y])];
  }

  function showLens() {
    lens.hidden = !(pointer && (drag?.moved ? selected?.point !== null : tool !== "select"));
    if (lens.hidden) return;
    const side = 132, context = lens.getContext("2d"), part = side / 4 * unit(); // it shows four times as much
    const [x, y] = pointer.map(value => value / unit());
    lens.style.left = `${clamp(x - side / 2, 0, Math.max(0, stage.clientWidth - side))}px`;
    lens.style.top = `${y > side + 40 ? y - side - 30 : y + 40}px`;
    [lens.width, lens.height] = [side, side];
    context.drawImage(view, pointer[0] - part / 2, pointer[1] - part / 2, part, part, 0, 0, side, side);
    context.globalCompositeOperation = "difference";
    context.strokeStyle = "#fff";
    context.stroke(new Path2D(`M${side / 2} 0V${side}M0 ${side / 2}H${side}`));
  }

  // ------------------------------------------------ the panel
  function showDetails() {
    const each = item(), box = get("details"), button = (text, onclick, id) => el("button", { onclick, id }, text);
    const isLengths = tool === "lengths" && drawn.length === 4;
    box.hidden = !each && !isLengths;
    if (!each) return box.replaceChildren(...(isLengths ? [fieldsOfLengths()] : []));
    const field = (text, id, value, set, type = "text") => el("label", {}, text,
      el("input", { id, value, type, step: "any", maxlength: 80, onchange: event => change(() => set(event.target.value.trim())) }));
    const choice = (text, id, value, values, set) => el("label", {}, text, el("select", { id, onchange: event =>
      change(() => set(event.target.value)) }, ...["", ...values].map(name => new Option(name || "–", name, false, name === (value ?? "")))));
    const names = ["name", "left", "right"].filter(key => each[key] !== undefined).map(key =>
      field(key[0].toUpperCase() + key.slice(1), `field-${key}`, each[key], text => { each[key] = text || each[key]; }));
    const sides = each.start && sideNames(each.start, each.end), inward = each.left === "in" ? "left" : each.right === "in" && "right";
    if (sides) names.push(
      choice("In is", "field-in", sides[inward], Object.values(sides), way => Object.assign(each, !way ? sides :
        way === sides.left ? { left: "in", right: "out" } : { left: "out", right: "in" })),
      choice("Approach", "field-approach", each.approach, data.approaches, arm => { each.approach = arm || undefined; }));
    const metres = (each.metres ?? []).map((value, i) => field(`Metres ${i ? "along" : "across"}`, `metres-${i}`, value,
      text => { each.metres[i] = Number(text) || 0; delete each.by; }, "number"));
    box.replaceChildren(el("h3", {}, `Selected ${KINDS[selected.kind]}`), ...names, ...metres,
      each.start ? button("Swap sides (S)", swap, "swap") : "", button("Delete (Del)", remove, "delete"));
  }

  /** Return fields that make a plane in metres of four points along a lane. */
  function fieldsOfLengths() {
    const inputs = [1, 3].map(first => el("input", { type: "number", step: "any", id: `length-${first}` }));
    const laneWidth = el("input", { type: "number", step: "any", id: "lane-width" });
    const set = event => {
      event.preventDefault();
      const pixels = drawn.map(point => point.map(value => value - 0.5)), lengths = inputs.map(input => Number(input.value));
      const made = laneWidth.value ? groundOfLane(pixels, Number(laneWidth.value), size, data.focal, lengths[0]) : levelGround(pixels, lengths, size);
      if (made) change(() => { places.ground = made; setTool("select"); });
      else say("These lengths do not fit the points: points 1 and 2, then 3 and 4, must go from near to far.");
    };
    return el("form", { onsubmit: set }, el("p", {}, "Ends of two known lengths along one straight lane, from near to far. The camera is assumed to be level."),
      ...inputs.map((input, i) => el("label", {}, `Points ${2 * i + 1} to ${2 * i + 2}, m`, input)),
      el("p", {}, "Or the width of a lane: points 1 and 2 on its left line, 3 and 4 on its right line, from near to far. Speeds also need the metres of points 1 to 2, such as a dash and its gap, unless the lens is known."),
      el("label", {}, "Width of the lane, m", laneWidth), el("button", {}, "Set the metres (Enter)"));
  }

  function showList() {
    const ground = fitGround(places.ground), rows = Object.keys(KINDS).flatMap(kind => places[kind].map((each, index) => {
      const result = { lines: found[index], zones: found[places.lines.length + index] }[kind];
      const counts = result?.border.directions.map(name => ({ name, ...countOf(result, name) }))
        .filter(({ total }, i) => i < 2 || total)
        .map(({ name, total, classes }) => `${name} ${total}${classes && ` (${classes})`}`).join(" · ");
      const there = each.metres && places.ground.length > 4 && ground?.toMetres(each.pixel);
      const error = there ? `, off by ${Math.hypot(there[0] - each.metres[0], there[1] - each.metres[1]).toFixed(2)} m` : "";
      const note = each.metres ? metresOf(each) + error : each.mask ? `mask ${each.mask}` : each.kind ?? "include";
      const choose = () => { selected = { kind, index, point: null }; refresh(); };
      return el("button", { class: "row", "aria-pressed": each === item(), onclick: choose },
        el("b", {}, each.name ?? `ground ${index + 1}`), el("span", {}, counts ?? note));
    }));
    get("list").replaceChildren(...(rows.length ? rows : [el("p", {}, "Nothing drawn yet. Choose Line or Zone to begin.")]));
  }

  function showResults() {
    const lines = found.slice(0, places.lines.length), problems = problemsOf(places, size);
    const warnings = lines.flatMap(({ border, visits }) =>
      warningsOf(border, visits, paths, data.span).map(text => `${border.name}: ${text}`));
    if (places.ground.some(point => point.by)) warnings.push(LANE_ONLY);
    warnings.push(...groundWarnings(fitGround(places.ground), paths));
    get("warnings").replaceChildren(...[...problems, ...warnings].map((text, i) =>
      el("li", { class: i < problems.length ? "problem" : "" }, text)));
    get("save").disabled = problems.length > 0;
    const names = found.filter(({ border }) => border.hasFlows).map(({ border }) => border.name), flows = flowsOf(found);
    get("flows").parentElement.hidden = names.length < 2;
    const row = (cell, ...texts) => el("tr", {}, ...texts.map(text => el(cell, {}, String(text))));
    get("flows").replaceChildren(row("th", "from", ...names.map(name => `to ${name}`), "to none"),
      ...names.map(from => row("td", from, ...[...names, ""].map(to => flows[`${from}\n${to}`] ?? 0))));
    get("text").textContent = writeYaml(places, size, rest, data.name);
    get("undo").disabled = !past.length;
    get("redo").disabled = !future.length;
  }

  function setTool(name) {
    [tool, drawn] = [name, []];
    if (name === "lengths") selected = null;
    for (const button of buttons) button.setAttribute("aria-pressed", button.dataset.tool === name);
    say(hint());
    refresh();
    showLens();
  }

  function refresh(isDragging = false) {
    recount();
    drawMarks();
    showList();
    if (!isDragging) showDetails(), showResults();
  }

  // ------------------------------------------------ pointer and keys
  function place(event) {
    const box = marks.getBoundingClientRect();
    return inside([(event.clientX - box.left) * width / box.width, (event.clientY - box.top) * height / box.height]);
  }

  function putPoint(point) {
    if (tool === "ground") {
      add("ground", { pixel: point.map(value => value - 0.5), metres: [0, 0] });
      return get("metres-0").select();
    }
    if (tool === "lengths" && drawn.length === 4) return;
    const isAt = other => Math.hypot(other[0] - point[0], other[1] - point[1]) < 10 * unit();
    if (drawn.length > 2 && isAt(drawn[0])) return endShape();
    if (!drawn.length || !isAt(drawn.at(-1))) drawn.push(point);
    if (tool === "line" && drawn.length === 2) endShape();
    if (tool === "lengths" && drawn.length === 4) showDetails(), get("length-1").focus({ preventScroll: true });
    drawMarks();
  }

  /** Return the names of both sides of a new line as one sees them: where in the image vehicles go. */
  function sideNames([x1, y1], [x2, y2]) {
    const isUpright = Math.abs(y2 - y1) > Math.abs(x2 - x1);
    const sides = isUpright ? ["left", "right"] : ["up", "down"], isReversed = isUpright ? y2 > y1 : x2 < x1;
    const [left, right] = isReversed ? sides.reverse() : sides;
    return { left, right };
  }

  function endShape() {
    const points = drawn, kind = tool;
    if (kind === "lengths" || points.length < (kind === "line" ? 2 : 3)) return;
    setTool("select");
    const [start, end] = points;
    if (kind === "line") add("lines", { name: freeName("line"), start, end, ...sideNames(start, end) });
    else if (kind === "zone") add("zones", { name: freeName("zone"), points });
    else add("regions", { name: freeName("region"), kind, points });
    get("field-name").select();
  }

  function press(event) {
    if (event.button) return;
    pointer = place(event);
    stage.setPointerCapture(event.pointerId);
    drag = { from: pointer, moved: false };
    if (tool !== "select") return showLens();
    const target = event.target.closest("[data-kind]"), point = event.target.dataset.point;
    const { kind, index } = target?.dataset ?? {};
    selected = target && { kind, index: Number(index), point: point ? Number(point) : null };
    drag = selected && { ...drag, before: JSON.stringify(places) };
    refresh();
  }

  function slide(event) {
    pointer = place(event);
    if (drag && !drag.moved && Math.hypot(pointer[0] - drag.from[0], pointer[1] - drag.from[1]) > 4 * unit()) {
      drag.moved = true;
      if (drag.before) [past, future] = [[...past, drag.before], []];
      else if (tool === "line" && !drawn.length) drawn.push(drag.from);
    }
    if (drag?.moved && drag.before) {
      move(pointer[0] - drag.from[0], pointer[1] - drag.from[1]);
      drag.from = pointer;
      refresh(true);
    } else if (!drag && tool === "select") hover(event);
    else drawMarks();
    showLens();
  }

  function release() {
    const ended = drag;
    drag = null;
    if (ended && tool !== "select") putPoint(pointer);
    else if (ended?.moved) refresh();
    showLens();
  }

  /** Show when and what the path nearest to the pointer is. */
  function hover(event) {
    const isOver = event.target.closest("[data-kind]") || !get("paths").checked;
    let best = 8 * unit(), nearest = null;
    for (const path of isOver ? [] : every)
      for (let row = 0; row < path.seen; row++) {
        const away = Math.abs(path.xs[row] - pointer[0]) + Math.abs(path.ys[row] - pointer[1]);
        if (away < best) [best, nearest] = [away, path];
      }
    if (nearest === hovered) return;
    hovered = nearest;
    const time = seconds => `${Math.floor(seconds / 60)}:${(seconds % 60).toFixed(1).padStart(4, "0")}`;
    const when = nearest && [0, nearest.seen - 1].map(row => time(nearest.times[row])).join(" to ");
    say(nearest ? `Vehicle ${nearest.vehicle}: ${nearest.kind}, ${when}` : hint());
    drawMarks();
  }

  function type(event) {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key, isControl = event.ctrlKey || event.metaKey;
    const isField = event.target.matches("select, input:not([type=checkbox])");
    const button = document.querySelector(`[data-key="${CSS.escape((isControl ? "^" : "") + key)}"]`), arrow = ARROWS[key];
    if (isField && key === "Enter" && event.target.form) return; // which accepts them
    if (isField && (key === "Enter" || key === "Escape")) {
      stage.focus({ preventScroll: true });
      return key === "Enter" && event.target.id === "metres-0" ? get("metres-1").select() : undefined;
    }
    if (isField || event.altKey || (event.target.tagName === "BUTTON" && key === "Enter")) return;
    if (isControl && event.shiftKey && key === "z") travel(future, past);
    else if (button) button.click(), stage.focus({ preventScroll: true });
    else if (isControl) return;
    else if (key === "s") swap();
    else if (key === "n" && selected) selected.point = ((selected.point ?? -1) + 1) % pointsOf(selected.kind, item()).length, drawMarks();
    else if (key === "Delete" || key === "Backspace") drawn.length ? (drawn.pop(), drawMarks(), showDetails()) : remove();
    else if (key === "Escape") selected = null, setTool("select");
    else if (key === "Enter" && tool !== "select") pressEnter();
    else if (arrow) step(arrow.map(value => value * (event.shiftKey ? 20 : 1)));
    else return;
    event.preventDefault();
  }

  /** Put a point where the crosshair is; where it was just put, the shape ends. */
  function pressEnter() {
    if (tool !== "lengths" && drawn.length > 2 && (!pointer || String(drawn.at(-1)) === String(pointer))) endShape();
    else putPoint(pointer ?? [width / 2, height / 2]);
  }

  function step(by) {
    if (tool === "select") return selected ? change(() => move(...by)) : undefined;
    pointer = inside((pointer ?? [width / 2, height / 2]).map((value, i) => value + by[i]));
    drawMarks();
    showLens();
  }

  // ------------------------------------------------ files
  function save() {
    const href = URL.createObjectURL(new Blob([get("text").textContent], { type: "application/yaml" }));
    el("a", { href, download: data.name }).click();
    URL.revokeObjectURL(href);
    saved = JSON.stringify(places);
    say(`Saved as ${data.name}. Use it: vdet detect-video CLIP -c ${data.name}`);
  }

  async function open({ target }) {
    const [file] = target.files;
    try {
      const read = readYaml(await file.text());
      if (String(read.size) !== String(size)) throw Error(`is for frames of ${read.size.join("×")}; open it with -c`);
      change(() => { [places, rest, selected, drawn] = [read.places, read.rest, null, []]; });
      say(`Opened ${file.name}.`);
    } catch (error) {
      say(`${file.name}: ${error.message}`);
    }
    target.value = "";
  }

  // ------------------------------------------------ start
  const actions = { undo: () => travel(past, future), redo: () => travel(future, past), save };
  for (const [id, action] of Object.entries(actions)) get(id).addEventListener("click", action);
  for (const button of buttons) button.addEventListener("click", () => setTool(button.dataset.tool));
  get("open").addEventListener("change", open);
  get("paths").addEventListener("change", paintPaths);
  const leave = () => { [pointer, hovered] = [null, null]; drawMarks(); showLens(); };
  const handlers = { pointerdown: press, pointermove: slide, pointerup: release, pointercancel: release,
    pointerleave: leave, dblclick: endShape };
  for (const [name, handler] of Object.entries(handlers)) stage.addEventListener(name, handler);
  addEventListener("keydown", type);
  addEventListener("beforeunload", event => { if (JSON.stringify(places) !== saved) event.preventDefault(); });
  setTool("select");
  new ResizeObserver(() => { paintPaths(); drawMarks(); }).observe(stage);
  document.body.dataset.ready = "yes";
}

openPage(JSON.parse(get("data").textContent)).catch(error => {
  get("hint").textContent = `This page cannot be shown: ${error.message}`;
});
