"use strict";

// The page of `vdet draw`. First the counting rule, which is pure; then numbers for the panel, the
// file, and at last what is drawn and edited. Points are [x, y] in pixels of the frame.

// ---------------------------------------------------------------- the rule, as vdet.traffic has it

const SETTLED = 0.1; // seconds after which a vehicle off the band has changed the side
const BAND = 0.05; // of the height of its box
const MIN_BAND = 0.003; // of the frame's height
const AT_EDGE = 0.002; // of the frame's side: points so near to the edge lie on it
const MAX_AT_EDGE = 0.005;
const INSIDE = 0.01; // pixels

/** Return where the way from a to b meets the segment from c to d, from 0 to 1, or null. */
function meeting([ax, ay], [bx, by], [[cx, cy], [dx, dy]]) {
  const ux = bx - ax, uy = by - ay, vx = dx - cx, vy = dy - cy;
  const area = ux * vy - uy * vx;
  if (area === 0) return null;
  const along = ((cx - ax) * vy - (cy - ay) * vx) / area;
  const across = ((cx - ax) * uy - (cy - ay) * ux) / area;
  return along >= 0 && along <= 1 && across >= 0 && across <= 1 ? along : null;
}

function metresOf(point) {
  return point.metres.map(value => Math.round(100 * value) / 100).join(", ");
}

function sidesOf(corners) {
  return corners.map((corner, i) => [corners.at(i - 1), corner]);
}

/** Return whether a point lies in a polygon, given its sides. */
function isInside(sides, x, y) {
  let inside = false;
  for (const [a, b] of sides)
    if ((a[1] > y) !== (b[1] > y) && x < a[0] + (y - a[1]) * ((b[0] - a[0]) / (b[1] - a[1]))) inside = !inside;
  return inside;
}

function distanceTo(segment, x, y) {
  const [a, b] = segment, wx = b[0] - a[0], wy = b[1] - a[1];
  const at = clamp(((x - a[0]) * wx + (y - a[1]) * wy) / (wx * wx + wy * wy), 0, 1);
  const dx = x - a[0] - at * wx, dy = y - a[1] - at * wy;
  return Math.sqrt(dx * dx + dy * dy); // Math.hypot is ten times as slow
}

function clamp(value, low, high) {
  return Math.min(Math.max(value, low), high);
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
  const reach = [
    atEdge(start) ? [start[0] - dx, start[1] - dy] : start,
    atEdge(end) ? [end[0] + dx, end[1] + dy] : end,
  ];
  return {
    isZone: false, name: line.name, directions: [line.left, line.right], start, end, length, size,
    bounds: boundsOf(reach),
    distance: (x, y) => (wx * (y - ay) - wy * (x - ax)) / length,
    meeting: (a, b) => meeting(a, b, reach),
  };
}

/** Place a zone, whose positive side is the inside; at the frame's edge it goes on beyond. */
function placeZone(zone, size) {
  const corners = zone.points.map(point => snapped(point, size));
  const every = sidesOf(corners), isAtEdge = ([a, b], i) => a[i] === b[i] && (a[i] === 0 || a[i] === size[i]);
  const sides = every.filter(side => !isAtEdge(side, 0) && !isAtEdge(side, 1));
  const right = size[0] - INSIDE, bottom = size[1] - INSIDE;
  const inFrame = ([x, y]) => [clamp(x, INSIDE, right), clamp(y, INSIDE, bottom)];
  return {
    isZone: true, name: zone.name, directions: ["enter", "exit", "appear", "vanish"], corners, size,
    bounds: boundsOf(corners),
    distance(x, y) {
      x = clamp(x, INSIDE, right);
      y = clamp(y, INSIDE, bottom);
      let distance = Infinity;
      for (const side of sides) distance = Math.min(distance, distanceTo(side, x, y));
      return isInside(every, x, y) ? distance : -distance;
    },
    meeting(a, b) {
      const met = sides.map(side => meeting(inFrame(a), inFrame(b), side)).filter(share => share !== null);
      return met.length ? Math.max(...met) : 1;
    },
  };
}

/** Return whether a path comes near a border at all; most paths do not. */
function mayMeet(path, border) {
  const [left, top, right, bottom] = border.bounds, [width, height] = border.size;
  let [x1, y1, x2, y2] = path.bounds ??= boundsOf(Array.from(path.xs, (x, i) => [x, path.ys[i]]));
  if (border.isZone) {
    [x1, x2] = [x1, x2].map(x => clamp(x, 0, width));
    [y1, y2] = [y1, y2].map(y => clamp(y, 0, height));
  }
  return x1 <= right && x2 >= left && y1 <= bottom && y2 >= top;
}

/**
 * Return what a vehicle does at a border, in order: time, row, direction, and for a zone seconds.
 * A path has times, xs, ys and heights; rows from `seen` on are where it would have driven on.
 */
function crossings(path, border) {
  if (!mayMeet(path, border)) return [];
  const found = changes(path, border);
  if (!border.isZone || !found.length) return found;
  found.forEach((each, i) => {
    if (i && each.direction === "exit") each.seconds = each.time - found[i - 1].time;
  });
  const last = path.seen - 1, final = found.at(-1);
  if (final.direction !== "exit") {
    const time = Math.max(path.times[last], final.time); // it may enter where it drives on
    found.push({ time, row: last, direction: "vanish", seconds: time - final.time });
  }
  return found;
}

/** Return the changes of the settled side, and where it begins in a zone. */
function changes(path, border) {
  const count = path.times.length, found = [];
  const distances = new Float64Array(count);
  let turns = 0;
  for (let row = 0; row < count; row++) {
    distances[row] = border.distance(path.xs[row], path.ys[row]);
    if (row && (distances[row] >= 0) !== (distances[row - 1] >= 0)) turns++;
  }
  if (!turns && !(distances[0] >= 0 && border.isZone)) return found;
  const settling = settle(path, border, distances);
  let settled = null, crossed = null; // the side, and where it crossed last
  for (let row = 0, end; row < count; row = end) {
    const isPositive = distances[row] >= 0;
    const rows = [];
    for (end = row; end < count && (distances[end] >= 0) === isPositive; end++)
      if (settling.settles[end]) rows.push(end);
    if (!rows.length || settled === isPositive) continue;
    if (settled !== null) {
      const { share, time, place } = meet(path, border, row);
      const way = crossed ? Math.hypot(crossed[0] - place[0], crossed[1] - place[1]) : Infinity;
      if (!rows.some(each => settling.isClear[each] || path.heights[each] <= way)) continue;
      crossed = share === null ? null : place;
      if (share !== null)
        found.push({ time, row: share ? row : row - 1, direction: border.directions[isPositive ? 0 : 1] });
    } else if (isPositive && border.isZone) {
      found.push({ time: path.times[0], row: 0, direction: "appear" });
    }
    settled = isPositive;
  }
  return found;
}

/** Return the rows that settle the side, and those one height of the box away from the border. */
function settle(path, border, distances) {
  const count = distances.length, settles = new Uint8Array(count), isClear = new Uint8Array(count);
  let since = 0, wasOff = false, wasFar = false;
  for (let row = 0; row < count; row++) {
    const away = Math.abs(distances[row]), height = path.heights[row];
    const isOff = away > Math.max(BAND * height, MIN_BAND * border.size[1]);
    const isFar = isOff && away >= height;
    const isSame = row > 0 && (distances[row] >= 0) === (distances[row - 1] >= 0);
    if (!(isOff && wasOff && isSame)) since = path.times[row];
    const far = wasFar && isSame;
    const seconds = Math.round(1e4 * (path.times[row] - since)) / 1e4;
    settles[row] = far || (isOff && seconds >= SETTLED) || (row === count - 1 && isFar);
    isClear[row] = isFar || far;
    wasOff = isOff;
    wasFar = isFar;
  }
  return { settles, isClear };
}

/** Return where a path meets a border between a row and the one before. */
function meet(path, border, row) {
  const a = [path.xs[row - 1], path.ys[row - 1]], b = [path.xs[row], path.ys[row]];
  const share = border.meeting(a, b), along = share ?? 1;
  return {
    share,
    time: path.times[row - 1] + along * (path.times[row] - path.times[row - 1]),
    place: [a[0] + along * (b[0] - a[0]), a[1] + along * (b[1] - a[1])],
  };
}

// ---------------------------------------------------------------- what follows from crossings

const NEAR = 0.5; // heights of the box within which a path that begins or ends is at a line
const FEW = 0.05; // fraction of the crossings up to which there is no warning

/** Return the sentences of a run about a line; visits are [path, its crossings]. */
function warningsOf(line, visits, paths, span) {
  if (!paths.length) return [];
  const found = [], crossed = new Set(visits.map(([path]) => path)), few = FEW * visits.length;
  const isNear = (path, row) =>
    path.times[row] > span[0] && path.times[row] < span[1] &&
    distanceTo([line.start, line.end], path.xs[row], path.ys[row]) <= NEAR * path.heights[row];
  const missed = paths.filter(path =>
    !crossed.has(path) && [0, path.seen - 1].some(row => isNear(path, row))).length;
  const again = visits.filter(([, some]) => some.length > 1).length;
  const heights = visits.flatMap(([path, some]) => some.map(each => path.heights[each.row]));
  if (!visits.length) found.push("no path crosses this line; move it");
  if (missed > few)
    found.push(`tracks that begin or end at this line and are not counted: ${missed}; ` +
      "move it to where vehicles are followed longer");
  if (again > few)
    found.push(`paths that cross this line more than once: ${again}; ` +
      "place it across the way of the vehicles");
  if (heights.length && line.length < quantile(heights, 0.5))
    found.push("this line is shorter than a vehicle; make it longer");
  return found;
}

function quantile(values, share) {
  const sorted = [...values].sort((a, b) => a - b), at = share * (sorted.length - 1);
  const low = Math.floor(at), high = Math.ceil(at);
  return sorted[low] + (at - low) * (sorted[high] - sorted[low]);
}

/** Return how many vehicles go from which place to which: a Map of Maps, with null for nowhere. */
function flowsOf(found) {
  const trips = new Map();
  for (const { border, visits } of found)
    for (const [path, some] of visits)
      for (const each of some)
        if (each.direction !== "exit" && each.direction !== "vanish") {
          if (!trips.has(path)) trips.set(path, []);
          trips.get(path).push({ name: border.name, time: Math.round(1000 * each.time), row: each.row });
        }
  const flows = new Map();
  for (const trip of trips.values()) {
    trip.sort((a, b) => a.time - b.time || a.row - b.row || (a.name < b.name ? -1 : 1));
    const to = trip.length > 1 ? trip.at(-1).name : null;
    if (!flows.has(trip[0].name)) flows.set(trip[0].name, new Map());
    const row = flows.get(trip[0].name);
    row.set(to, (row.get(to) ?? 0) + 1);
  }
  return flows;
}

// ---------------------------------------------------------------- the road plane

/** Solve a system of linear equations by Gaussian elimination; null where it has no solution. */
function solve(rows, values) {
  const size = rows.length, table = rows.map((row, i) => [...row, values[i]]);
  for (let column = 0; column < size; column++) {
    let best = column;
    for (let row = column; row < size; row++)
      if (Math.abs(table[row][column]) > Math.abs(table[best][column])) best = row;
    [table[column], table[best]] = [table[best], table[column]];
    if (Math.abs(table[column][column]) < 1e-12) return null;
    for (let row = 0; row < size; row++) {
      const factor = row === column ? 0 : table[row][column] / table[column][column];
      for (let at = column; factor && at <= size; at++) table[row][at] -= factor * table[column][at];
    }
  }
  return table.map((row, i) => row[size] / row[i]);
}

/** Return a function that moves points by a homography; null where they would be behind it. */
function mapping(h) {
  return ([x, y]) => {
    const depth = h[6] * x + h[7] * y + h[8];
    return depth > 1e-9 ? [(h[0] * x + h[1] * y + h[2]) / depth, (h[3] * x + h[4] * y + h[5]) / depth] : null;
  };
}

function inverse(h) {
  const [a, b, c, d, e, f, g, i, j] = h;
  return [e * j - f * i, c * i - b * j, b * f - c * e, f * g - d * j, a * j - c * g, c * d - a * f,
    d * i - e * g, b * g - a * i, a * e - b * d];
}

/** Move and scale points so that they lie around 0 at a distance of about 1. */
function normalized(points) {
  const middle = [0, 1].map(i => points.reduce((sum, point) => sum + point[i], 0) / points.length);
  const scale = Math.max(...points.map(point => Math.hypot(point[0] - middle[0], point[1] - middle[1]))) || 1;
  return { middle, scale, points: points.map(point => point.map((value, i) => (value - middle[i]) / scale)) };
}

/** Fit the road plane to points with pixel and metres; null where they do not fix one. */
function fitGround(points) {
  if (points.length < 4) return null;
  const pixels = normalized(points.map(each => each.pixel)), metres = normalized(points.map(each => each.metres));
  const equations = points.flatMap((_, n) => {
    const [x, y] = metres.points[n], [u, v] = pixels.points[n];
    return [[[x, y, 1, 0, 0, 0, -u * x, -u * y], u], [[0, 0, 0, x, y, 1, -v * x, -v * y], v]];
  });
  let h = null;
  for (let pass = 0; pass < 4; pass++) { // from the second pass on, by distances in pixels
    const weights = points.map((_, n) => {
      const depth = h ? h[6] * metres.points[n][0] + h[7] * metres.points[n][1] + 1 : 1;
      return 1 / (depth * depth);
    });
    const sum = (i, j) => equations.reduce((total, [row, value], n) =>
      total + weights[n >> 1] * row[i] * (j < 8 ? row[j] : value), 0);
    const rows = Array.from({ length: 8 }, (_, i) => Array.from({ length: 8 }, (_, j) => sum(i, j)));
    h = solve(rows, Array.from({ length: 8 }, (_, i) => sum(i, 8)));
    if (!h) return null;
  }
  const toPixels = oriented([...h, 1], metres.points), toMetres = oriented(inverse([...h, 1]), pixels.points);
  if (!toPixels || !toMetres) return null;
  const via = (from, matrix, to) => point => {
    const moved = mapping(matrix)(point.map((value, i) => (value - from.middle[i]) / from.scale));
    return moved && moved.map((value, i) => to.middle[i] + to.scale * value);
  };
  return { toMetres: via(pixels, toMetres, metres), toPixels: via(metres, toPixels, pixels) };
}

/** Return a homography with positive depths at points; null where the horizon is between them. */
function oriented(h, points) {
  const signs = new Set(points.map(([x, y]) => Math.sign(h[6] * x + h[7] * y + h[8])));
  const [sign] = signs;
  return signs.size === 1 && sign ? h.map(value => sign * value) : null;
}

/** Return the speed of a vehicle at a moment in km/h, from the places of one second; or null. */
function speedAt(path, time, ground) {
  const last = path.seen - 1, from = clamp(time - 0.5, path.times[0], Math.max(path.times[0], path.times[last] - 1));
  const places = [];
  for (let row = 0; row <= last; row++)
    if (path.times[row] >= from && path.times[row] <= from + 1) {
      const place = ground.toMetres([path.xs[row] - 0.5, path.ys[row] - 0.5]);
      if (place) places.push([path.times[row], ...place]);
    }
  if (places.length < 3 || places.at(-1)[0] - places[0][0] < 0.5) return null;
  const mean = [0, 1, 2].map(i => places.reduce((sum, each) => sum + each[i], 0) / places.length);
  const slope = i => places.reduce((sum, each) => sum + (each[0] - mean[0]) * (each[i] - mean[i]), 0) /
    places.reduce((sum, each) => sum + (each[0] - mean[0]) ** 2, 0);
  return 3.6 * Math.hypot(slope(1), slope(2));
}

// ---------------------------------------------------------------- the file

const MARK = "# Drawn with vdet draw";
const FORMS = { // the lists of the file: their section, and what their items have
  ground: ["camera", ["pixel", "metres"]],
  regions: ["", ["name", "kind", "points", "mask"]],
  lines: ["traffic", ["name", "start", "end", "left", "right"]],
  zones: ["traffic", ["name", "points"]],
};

/** Write the settings of the camera as YAML; `rest` has the lines of everything else. */
function writeYaml(places, size, rest, name) {
  const write = value => Array.isArray(value) ? `[${value.map(write).join(", ")}]` :
    typeof value === "number" ? String(Math.round(1000 * value) / 1000) :
    value === "include" || value === "exclude" ? value : JSON.stringify(value);
  const list = (kind, indent, note) => places[kind].length ? [
    `${indent}${kind}:  # ${note}`,
    ...places[kind].map(item => `${indent}  - {${FORMS[kind][1].filter(key => item[key] !== undefined && item[key] !== null)
      .map(key => `${key}: ${key === "name" || key === "left" || key === "right" ? JSON.stringify(item[key]) : write(item[key])}`).join(", ")}}`),
  ] : [];
  const traffic = [
    ...list("lines", "  ", "left and right of someone who looks from start to end"),
    ...list("zones", "  ", "polygons in which vehicles are counted"), ...rest.traffic];
  return [
    `${MARK}: this file says where the vehicles of a camera are counted.`,
    `# vdet detect-video CLIP --no-video -c ${name} --flows flows.csv --interval 15min`,
    "camera:", `  size: ${write(size)}  # points below are pixels of such frames`,
    ...list("ground", "  ", "points of the road in pixels and metres"), ...rest.camera,
    ...list("regions", "", "parts of the frame in which vehicles are shown"),
    ...(traffic.length ? ["traffic:", ...traffic] : []), ...rest.other, "",
  ].join("\n");
}

/** Read a file that `writeYaml` has written: size, places and rest. Raises an Error for others. */
function readYaml(text) {
  if (!text.startsWith(MARK)) throw Error("not written by this page; open it with vdet draw CLIP -c FILE");
  const places = { ground: [], regions: [], lines: [], zones: [] };
  const rest = { camera: [], traffic: [], other: [] };
  let section = "other", list = null, size = null;
  for (const line of text.split("\n").filter(line => line.trim() && !line.startsWith("#"))) {
    const key = /^( *)(\w+):/.exec(line);
    const item = /^ *- (\{.*\})$/.exec(line);
    const isTop = key && !key[1];
    if (isTop) section = key[2] === "camera" || key[2] === "traffic" ? key[2] : "other";
    if (key && FORMS[key[2]] && FORMS[key[2]][0] === (isTop ? "" : section) && key[1].length < 3) list = key[2];
    else if (list && item) places[list].push(readItem(item[1]));
    else if (/^ *-/.test(line) && list) throw Error(`not as this page writes it: ${line.trim()}`);
    else {
      list = null;
      const given = section === "camera" && /^  size: (\[.*?\])/.exec(line);
      if (given) size = JSON.parse(given[1]);
      else if (!isTop || section === "other") rest[section].push(line);
    }
  }
  if (!size) throw Error("has no camera.size");
  return { size, places, rest };
}

/** Read `{name: "gate", start: [1, 2]}`: JSON, but for the quotes of plain words. */
function readItem(text) {
  return JSON.parse(text.replace(/"(?:\\.|[^"\\])*"|[A-Za-z_]\w*/g,
    part => part.startsWith('"') ? part : JSON.stringify(part)));
}

/** Return what is wrong with places, in sentences; a run would refuse them. */
function problemsOf(places, size) {
  const found = [], names = new Set();
  for (const item of [...places.lines, ...places.zones]) {
    if (names.has(item.name)) found.push(`${item.name}: this name is used twice`);
    names.add(item.name);
  }
  if (new Set(places.regions.map(item => item.name)).size < places.regions.length)
    found.push("regions: a name is used twice");
  for (const line of places.lines) {
    const length = [0, 1].map(i => Math.abs(line.start[i] - line.end[i]) / size[i]);
    if (Math.max(...length) < 0.01) found.push(`${line.name}: is shorter than 1 % of the frame`);
    if (line.left === line.right) found.push(`${line.name}: both sides have one name`);
  }
  for (const item of [...places.zones, ...places.regions])
    if (item.points && crossesItself(item.points)) found.push(`${item.name}: crosses or touches itself`);
  if (places.ground.length && !fitGround(places.ground))
    found.push(places.ground.length < 4 ? "ground: needs four points or more, with their metres" :
      "ground: these points do not fix a plane; check their metres");
  return found;
}

function crossesItself(corners) {
  const sides = sidesOf(corners);
  return sides.some((side, i) => sides.some((other, j) =>
    j > i + 1 && !(i === 0 && j === sides.length - 1) && meeting(...side, other) !== null));
}

// ---------------------------------------------------------------- the linked paths

/** Return the paths that Python packs: differences in four planes of bytes, deflated. */
async function readPaths(packed) {
  const bytes = Uint8Array.from(atob(packed.data), char => char.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer()), count = planes.length / 4;
  const steps = Int32Array.from({ length: count }, (_, i) =>
    planes[i] | planes[count + i] << 8 | planes[2 * count + i] << 16 | planes[3 * count + i] << 24);
  const rows = count / 4;
  let first = 0;
  return packed.vehicles.map(([vehicle, kind, start, seen, length]) => {
    const column = (number, unit, before = 0) => {
      let step = 0, value = 0;
      return Float64Array.from({ length }, (_, i) => {
        step += steps[number * rows + first + i];
        value += step;
        return before + value / unit;
      });
    };
    const path = {
      vehicle, kind, seen,
      times: column(0, 1e6).map(time => Math.round(1e6 * (start + time)) / 1e6),
      xs: column(1, 100), ys: column(2, 100), heights: column(3, 1),
    };
    first += length;
    return path;
  });
}

if (typeof module !== "undefined") module.exports = {
  placeLine, placeZone, crossings, warningsOf, flowsOf, fitGround, speedAt, writeYaml, readYaml, problemsOf, readPaths,
};

// ---------------------------------------------------------------- the page

const KINDS = { lines: "line", zones: "zone", regions: "region", ground: "point" };
const HINTS = {
  select: "Click a line, a zone or a path; drag it or its handles. Click a dashed line to take it over.",
  line: "Click where the line begins, then where it ends, across the way of the vehicles.",
  zone: "Click the corners; end with Enter, a double click, or a click on the first corner.",
  include: "Click the corners of the region in which vehicles count; end with Enter or a double click.",
  exclude: "Click the corners of the region in which vehicles do not count; end with Enter.",
  ground: "Click a point of the road, then type its metres. From four points on, a grid appears.",
};
const KEYS = { v: "select", l: "line", z: "zone", i: "include", x: "exclude", g: "ground" };
const LENS = { side: 132, zoom: 4 };

/** Make an element; texts are never read as HTML. */
function el(tag, attributes = {}, ...children) {
  const isDrawn = ["g", "line", "polygon", "polyline", "circle", "path", "text", "tspan"].includes(tag);
  const made = isDrawn ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes))
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else made.setAttribute(name, value);
  made.append(...children);
  return made;
}

function get(id) {
  return document.getElementById(id);
}

async function openPage(data) {
  const [width, height] = data.size, size = data.size;
  const stage = get("stage"), view = get("view"), marks = get("marks"), lens = get("lens");
  const every = await readPaths(data.paths);
  const kinds = [...new Set(every.map(path => path.kind))].sort();
  const image = new Image();
  image.src = data.picture;
  await image.decode();

  for (const line of data.places.lines) Object.assign(line, { left: "left", right: "right", ...line });
  let places = data.places, rest = data.rest;
  let past = [], future = [], saved = JSON.stringify(places);
  let tool = "select", selected = null, drawn = [], pointer = null, drag = null, hovered = null;
  const hidden = new Set();
  let paths = every, regionsKey = "[]", found = [];
  const known = new Map(); // results by the geometry of a border

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
    places = JSON.parse(from.pop());
    selected = null;
    drawn = [];
    refresh();
  }

  function item() {
    return selected && places[selected.kind][selected.index];
  }

  function freeName(stem) {
    const names = new Set([...places.lines, ...places.zones, ...places.regions].map(each => each.name));
    let number = 1;
    while (names.has(`${stem} ${number}`)) number++;
    return `${stem} ${number}`;
  }

  function add(kind, made) {
    change(() => {
      places[kind].push(made);
      selected = { kind, index: places[kind].length - 1, point: null };
    });
  }

  function remove() {
    if (!selected) return;
    const points = item().points;
    change(() => {
      if (points && selected.point !== null && points.length > 3) points.splice(selected.point, 1);
      else places[selected.kind].splice(selected.index, 1), selected = null;
      if (selected) selected.point = null;
    });
  }

  function swap() {
    if (selected?.kind === "lines")
      change(() => { const line = item(); [line.left, line.right] = [line.right, line.left]; });
  }

  /** Return the points of an item, each as it is shown; ground points are middles of pixels. */
  function pointsOf(kind, each) {
    if (kind === "lines") return [each.start, each.end];
    return kind === "ground" ? [each.pixel.map(value => value + 0.5)] : each.points ?? [];
  }

  function setPoint(kind, each, number, [x, y]) {
    const point = [clamp(x, 0, width), clamp(y, 0, height)].map(value => Math.round(10 * value) / 10);
    if (kind === "lines") each[number ? "end" : "start"] = point;
    else if (kind === "ground") each.pixel = point.map(value => value - 0.5);
    else each.points[number] = point;
  }

  function move(dx, dy) {
    const each = item(), points = pointsOf(selected.kind, each);
    points.forEach(([x, y], number) => {
      if (selected.point === null || selected.point === number) setPoint(selected.kind, each, number, [x + dx, y + dy]);
    });
  }

  // ------------------------------------------------ counts

  function recount() {
    const regions = places.regions.filter(each => each.points);
    const key = JSON.stringify(regions.map(each => [each.kind, each.points]));
    if (key !== regionsKey) {
      regionsKey = key;
      known.clear();
      paths = regions.length ? every.map(path => within(path, regions)).filter(path => path) : every;
    }
    found = [...places.lines.map(line => placeLine(line, size)), ...places.zones.map(zone => placeZone(zone, size))]
      .map(border => {
        const shape = JSON.stringify([border.isZone, border.bounds, border.start ?? border.corners, border.isZone ? 0 : border.directions]);
        if (!known.has(shape)) {
          if (known.size > 50) known.clear();
          known.set(shape, paths.map(path => [path, crossings(path, border)]).filter(([, some]) => some.length));
        }
        return { border, visits: known.get(shape) };
      });
  }

  /** Return the part of a path inside the regions; null where nothing is left. */
  function within(path, regions) {
    const shows = regions.some(each => each.kind !== "exclude");
    const rows = [...path.times.keys()].filter(row => {
      const inside = each => isInside(sidesOf(each.points), clamp(path.xs[row], 0, width - 1), clamp(path.ys[row], 0, height - 1));
      return (!shows || regions.some(each => each.kind !== "exclude" && inside(each))) &&
        !regions.some(each => each.kind === "exclude" && inside(each));
    });
    if (rows.length === path.times.length) return path;
    const seen = rows.filter(row => row < path.seen).length;
    const pick = values => Float64Array.from(rows, row => values[row]);
    return seen ? { ...path, bounds: undefined, seen, times: pick(path.times), xs: pick(path.xs),
      ys: pick(path.ys), heights: pick(path.heights) } : null;
  }

  function countOf({ visits }, direction) {
    const counts = new Map();
    for (const [path, some] of visits)
      for (const each of some)
        if (each.direction === direction) counts.set(path.kind, (counts.get(path.kind) ?? 0) + 1);
    const total = [...counts.values()].reduce((sum, count) => sum + count, 0);
    const classes = [...counts].sort(([, a], [, b]) => b - a).map(([kind, count]) => `${count} ${kind}`).join(", ");
    return { total, classes: kinds.length > 1 ? classes : "" };
  }

  function speedsOf({ border, visits }, ground) {
    return border.directions.slice(0, 2).map(direction => visits.flatMap(([path, some]) =>
      some.filter(each => each.direction === direction)
        .map(each => speedAt(path, each.time, ground)).filter(speed => speed !== null)));
  }

  // ------------------------------------------------ the picture

  function hue([x1, y1], [x2, y2]) {
    return `hsl(${Math.round(Math.atan2(y2 - y1, x2 - x1) * 180 / Math.PI + 360) % 360} 90% 58%)`;
  }

  function paintPaths() {
    const context = view.getContext("2d"), scale = width / Math.max(1, stage.clientWidth);
    [view.width, view.height] = size;
    context.drawImage(image, 0, 0, width, height);
    if (!get("paths").checked) return;
    context.lineWidth = Math.max(1.5, 1.5 * scale);
    context.globalAlpha = clamp(8 / Math.sqrt(every.length), 0.2, 0.8);
    for (const path of every) {
      if (hidden.has(path.kind)) continue;
      const last = path.seen - 1, step = 2 * scale;
      context.strokeStyle = hue([path.xs[0], path.ys[0]], [path.xs[last], path.ys[last]]);
      context.beginPath();
      let [x, y] = [-1e9, 0];
      for (let row = 0; row <= last; row++)
        if (row === last || Math.abs(path.xs[row] - x) + Math.abs(path.ys[row] - y) > step)
          context.lineTo([x] = [path.xs[row]], [y] = [path.ys[row]]);
      context.stroke();
    }
  }

  function label(at, lines, anchor, name) {
    const unit = width / stage.clientWidth, letter = stage.clientWidth < 600 ? 10 : 13;
    const text = el("text", {
      x: at[0], y: at[1], "font-size": letter * unit, "text-anchor": anchor, class: name });
    lines.forEach((line, i) => text.append(el("tspan", { x: at[0], dy: i ? 1.15 * letter * unit : 0 }, line)));
    return text;
  }

  function drawMarks() {
    const unit = width / Math.max(1, stage.clientWidth);
    marks.replaceChildren();
    const ground = fitGround(places.ground);
    if (ground) drawGrid(ground, unit);
    data.proposals.forEach((each, number) => {
      const isTaken = places.lines.some(line => JSON.stringify([line.start, line.end]) === JSON.stringify([each.start, each.end]));
      if (isTaken || tool !== "select") return;
      const ends = { x1: each.start[0], y1: each.start[1], x2: each.end[0], y2: each.end[1] };
      marks.append(el("g", { class: "proposal", "data-proposal": number },
        el("line", { ...ends, class: "grip" }), el("line", ends),
        label([(ends.x1 + ends.x2) / 2, (ends.y1 + ends.y2) / 2 - 8 * unit], [`+ ${each.name}: ${each.vehicles}`], "middle", "")));
    });
    for (const kind of ["regions", "zones", "lines", "ground"])
      places[kind].forEach((each, index) => drawItem(kind, each, index, unit));
    if (hovered) {
      const points = Array.from({ length: hovered.seen }, (_, row) => `${hovered.xs[row]},${hovered.ys[row]}`);
      marks.append(el("polyline", { points: points.join(" "), class: "hovered" }));
    }
    if (drawn.length) {
      const points = pointer ? [...drawn, pointer] : drawn;
      marks.append(el("polyline", { points: points.join(" "), class: "new" }),
        ...drawn.map(([cx, cy]) => el("circle", { cx, cy, r: 5 * unit, class: "new" })));
    } else if (pointer && tool !== "select") {
      marks.append(el("circle", { cx: pointer[0], cy: pointer[1], r: 5 * unit, class: "new" }));
    }
  }

  function drawItem(kind, each, index, unit) {
    const isSelected = selected?.kind === kind && selected.index === index, points = pointsOf(kind, each);
    if (!points.length) return; // a mask
    const group = el("g", { class: `${each.kind ?? kind} ${isSelected ? "selected" : ""}`, "data-kind": kind, "data-index": index });
    if (kind === "lines") {
      const [[x1, y1], [x2, y2]] = points, ends = { x1, y1, x2, y2 };
      group.append(el("line", { ...ends, class: "grip" }), el("line", ends));
      const length = Math.hypot(x2 - x1, y2 - y1) || 1, result = found[index];
      const left = [(y2 - y1) / length, (x1 - x2) / length], middle = [(x1 + x2) / 2, (y1 + y2) / 2];
      [[left, each.left], [left.map(value => -value), each.right]].forEach(([way, name]) => {
        const tip = middle.map((value, i) => value + 26 * unit * way[i]);
        const wing = angle => [0, 1].map(i => tip[i] - 8 * unit * (way[i] * Math.cos(angle) - (i ? -1 : 1) * way[1 - i] * Math.sin(angle)));
        const { total, classes } = countOf(result, name);
        const at = [clamp(tip[0] + 10 * unit * way[0], 4 * unit, width - 4 * unit), clamp(tip[1] + (way[1] > 0.3 ? 16 : way[1] < -0.3 ? (classes ? -22 : -7) : 4) * unit, 14 * unit, height - 4 * unit)];
        group.append(el("polyline", { points: [middle, tip, wing(0.5), tip, wing(-0.5)].join(" ") }),
          label(at, [`${name} ${total}`, ...(classes ? [classes] : [])], way[0] > 0.5 ? "start" : way[0] < -0.5 ? "end" : "middle", "count"));
      });
      group.append(label([x1, y1 - 9 * unit], [each.name], x1 < width / 12 ? "start" : x1 > width * 11 / 12 ? "end" : "middle", ""));
    } else if (kind === "ground") {
      group.append(label([points[0][0] + 9 * unit, points[0][1] - 6 * unit], [`${metresOf(each)} m`], points[0][0] > 0.85 * width ? "end" : "start", ""));
    } else {
      const top = points.reduce((best, point) => point[1] < best[1] ? point : best);
      const texts = [each.name];
      if (kind === "zones") {
        const result = found[places.lines.length + index];
        const [enter, exit, appear, vanish] = ["enter", "exit", "appear", "vanish"].map(name => countOf(result, name).total);
        texts.push(`in ${enter + appear}, out ${exit + vanish}`);
      }
      group.append(el("polygon", { points: points.join(" ") }), label([top[0], top[1] + 18 * unit], texts, "middle", ""));
    }
    if (isSelected || kind === "ground")
      points.forEach(([cx, cy], point) => group.append(
        el("circle", { cx, cy, r: 15 * unit, class: "grip", "data-point": point }),
        el("circle", { cx, cy, r: (selected?.point === point && isSelected ? 8 : 6) * unit, class: "handle" })));
    marks.append(group);
  }

  function drawGrid(ground, unit) {
    const metres = places.ground.map(each => each.metres), [left, low, right, high] = boundsOf(metres);
    const step = [1, 2, 5, 10, 20, 50, 100].find(step => Math.max(right - left, high - low) / step <= 14) ?? 200;
    const grid = (from, to, at) => {
      for (let value = Math.ceil(from / step) * step; value <= to + 1e-9; value += step) {
        const points = Array.from({ length: 25 }, (_, i) => ground.toPixels(at(value, i / 24))).filter(point => point);
        marks.append(el("polyline", { points: points.map(([x, y]) => [x + 0.5, y + 0.5]).join(" "), class: "grid" }));
        if (points.length) marks.append(label(points[0], [`${value} m`], "middle", "grid"));
      }
    };
    grid(left, right, (x, share) => [x, low + share * (high - low)]);
    grid(low, high, (y, share) => [left + share * (right - left), y]);
  }

  function showLens() {
    const isNeeded = pointer && (drag?.moved ? selected?.point !== null : tool !== "select");
    lens.hidden = !isNeeded;
    if (!isNeeded) return;
    const { side, zoom } = LENS, context = lens.getContext("2d"), scale = stage.clientWidth / width;
    const [x, y] = pointer.map(value => value * scale), part = side / zoom / scale;
    lens.style.left = `${clamp(x - side / 2, 0, Math.max(0, stage.clientWidth - side))}px`;
    lens.style.top = `${y > side + 40 ? y - side - 30 : y + 40}px`;
    [lens.width, lens.height] = [side, side];
    context.fillRect(0, 0, side, side);
    context.imageSmoothingEnabled = false;
    context.drawImage(view, pointer[0] - part / 2, pointer[1] - part / 2, part, part, 0, 0, side, side);
    context.strokeStyle = "#fff";
    context.globalCompositeOperation = "difference";
    context.stroke(new Path2D(`M${side / 2} 0V${side}M0 ${side / 2}H${side}`));
  }

  // ------------------------------------------------ the panel

  function input(value, set, more = {}) {
    return el("input", { value, ...more, onchange: event => change(() => set(event.target.value)) });
  }

  function showDetails() {
    const each = item(), box = get("details"), number = { type: "number", step: "0.01" };
    const field = (name, control) => el("label", {}, name, control);
    const named = key => input(each[key], value => { each[key] = value.trim().slice(0, 80) || each[key]; }, { maxlength: 80, id: `field-${key}` });
    box.hidden = !each;
    if (!each) return box.replaceChildren();
    const parts = [el("h3", {}, `Selected ${KINDS[selected.kind]}`)];
    if (each.name !== undefined) parts.push(field("Name", named("name")));
    if (selected.kind === "lines")
      parts.push(field("Left", named("left")), field("Right", named("right")), el("button", { onclick: swap }, "Swap sides (S)"));
    if (selected.kind === "ground") {
      ["across", "along"].forEach((name, i) => parts.push(field(`Metres ${name}`,
        input(each.metres[i], value => { each.metres[i] = Number(value) || 0; }, { ...number, id: `metres-${i}` }))));
      if (places.ground.length === 4) {
        const sides = [3.5, 20].map(value => el("input", { ...number, value }));
        const apply = () => change(() => [[0, 0], [1, 0], [1, 1], [0, 1]].forEach((corner, i) => {
          places.ground[i].metres = corner.map((value, axis) => value * (Number(sides[axis].value) || 1));
        }));
        parts.push(el("p", {}, "Clicked near left, near right, far right, far left of a straight stretch of road?"),
          field("It is wide, m", sides[0]), field("long, m", sides[1]), el("button", { onclick: apply, id: "stretch" }, "Set these metres"));
      }
    }
    box.replaceChildren(...parts, el("button", { onclick: remove }, "Delete (Del)"));
  }

  function showList() {
    const rows = Object.keys(KINDS).flatMap(kind => places[kind].map((each, index) => {
      const isSelected = selected?.kind === kind && selected.index === index;
      const result = kind === "lines" ? found[index] : kind === "zones" ? found[places.lines.length + index] : null;
      const counts = result ? result.border.directions.map(name => [name, countOf(result, name)]).filter(([, count], i) => i < 2 || count.total)
        .map(([name, { total, classes }]) => `${name} ${total}${classes ? ` (${classes})` : ""}`).join(" · ") : "";
      const note = counts || (kind === "ground" ? `${metresOf(each)} m${errorOf(index)}` : each.mask ? `mask ${each.mask}` : each.kind ?? "include");
      return el("button", { class: "row", "aria-pressed": isSelected, onclick: () => choose({ kind, index, point: null }) },
        el("b", {}, each.name ?? `ground ${index + 1}`), el("span", {}, note));
    }));
    get("list").replaceChildren(...(rows.length ? rows : [el("p", {}, "Nothing is drawn yet.")]));
  }

  function errorOf(index) {
    const ground = fitGround(places.ground), there = ground?.toMetres(places.ground[index].pixel);
    if (!there || places.ground.length < 5) return "";
    const [x, y] = places.ground[index].metres;
    return `, off by ${Math.hypot(there[0] - x, there[1] - y).toFixed(2)} m`;
  }

  function showResults() {
    const ground = fitGround(places.ground), lines = found.slice(0, places.lines.length);
    const warnings = lines.flatMap(({ border, visits }) => warningsOf(border, visits, paths, data.span).map(text => `${border.name}: ${text}`));
    const problems = problemsOf(places, size);
    get("warnings").replaceChildren(...problems.map(text => el("li", { class: "problem" }, text)), ...warnings.map(text => el("li", {}, text)));
    get("save").disabled = problems.length > 0;
    const table = get("flows"), names = found.map(({ border }) => border.name), flows = flowsOf(found);
    table.parentElement.hidden = names.length < 2;
    table.replaceChildren(el("tr", {}, ...["from", ...names.map(name => `to ${name}`), "to none"].map(text => el("th", {}, text))),
      ...names.map(from => el("tr", {}, el("td", {}, from), ...[...names, null].map(to => el("td", {}, String(flows.get(from)?.get(to) ?? 0))))));
    get("speeds").replaceChildren(...(ground ? lines.flatMap(result => speedsOf(result, ground).map((speeds, i) => speedRow(result.border, i, speeds))) : []));
    get("speeds").hidden = !ground;
    get("text").textContent = writeYaml(places, size, rest, data.name);
    get("undo").disabled = !past.length;
    get("redo").disabled = !future.length;
  }

  function speedRow(border, side, speeds) {
    if (!speeds.length) return "";
    const bars = new Array(16).fill(0);
    for (const speed of speeds) bars[Math.min(15, Math.floor(speed / 10))]++;
    const most = Math.max(...bars), text = `median ${quantile(speeds, 0.5).toFixed(0)} km/h, 85 % ${quantile(speeds, 0.85).toFixed(0)} km/h`;
    return el("div", { class: "speed" }, el("b", {}, `${border.name}: ${border.directions[side]}`), el("span", {}, text),
      el("div", { class: "bars", title: "0 to 160 km/h, by 10 km/h" }, ...bars.map(count => el("i", { style: `height: ${100 * count / most}%` }))));
  }

  function choose(what) {
    selected = what;
    refresh();
  }

  function setTool(name) {
    [tool, drawn] = [name, []];
    for (const button of document.querySelectorAll("[data-tool]")) button.setAttribute("aria-pressed", button.dataset.tool === name);
    say(HINTS[name]);
    drawMarks();
    showLens();
  }

  function say(text) {
    get("hint").textContent = text;
  }

  function refresh(isDragging = false) {
    recount();
    drawMarks();
    showList();
    if (isDragging) return;
    showDetails();
    showResults();
  }

  // ------------------------------------------------ pointer and keys

  function place(event) {
    const box = marks.getBoundingClientRect();
    return [(event.clientX - box.left) * width / box.width, (event.clientY - box.top) * height / box.height]
      .map((value, i) => Math.round(10 * clamp(value, 0, size[i])) / 10);
  }

  function putPoint(point) {
    if (tool === "ground") {
      add("ground", { pixel: point.map(value => value - 0.5), metres: [0, 0] });
      get("metres-0").focus({ preventScroll: true });
      return;
    }
    const unit = width / stage.clientWidth, isNear = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]) < 10 * unit;
    if (drawn.length > 2 && isNear(drawn[0], point)) return endShape();
    if (!drawn.length || !isNear(drawn.at(-1), point)) drawn.push(point);
    if (tool === "line" && drawn.length === 2) endShape();
    drawMarks();
  }

  function endShape() {
    const points = drawn, kind = tool;
    if (points.length < (kind === "line" ? 2 : 3)) return;
    setTool("select");
    if (kind === "line") add("lines", { name: freeName("line"), start: points[0], end: points[1], left: "left", right: "right" });
    else if (kind === "zone") add("zones", { name: freeName("zone"), points });
    else add("regions", { name: freeName("region"), kind, points });
    get("field-name")?.select();
  }

  function press(event) {
    if (event.button) return;
    pointer = place(event);
    stage.setPointerCapture(event.pointerId);
    if (tool !== "select") {
      drag = { from: pointer, moved: false };
      if (event.pointerType === "mouse" || drawn.length) return;
      return showLens();
    }
    const target = event.target.closest("[data-kind], [data-proposal]"), point = event.target.dataset.point;
    if (target?.dataset.proposal) {
      const { name, left, right, start, end } = data.proposals[target.dataset.proposal];
      const isUsed = places.lines.some(line => line.name === name);
      return add("lines", { name: isUsed ? freeName(name) : name, start, end, left, right });
    }
    selected = target && { kind: target.dataset.kind, index: Number(target.dataset.index), point: point === undefined ? null : Number(point) };
    if (selected?.kind === "ground") selected.point = 0;
    drag = selected && { from: pointer, moved: false, before: JSON.stringify(places) };
    refresh();
  }

  function slide(event) {
    pointer = place(event);
    if (drag && !drag.moved && Math.hypot(pointer[0] - drag.from[0], pointer[1] - drag.from[1]) > 4 * width / stage.clientWidth) {
      drag.moved = true;
      if (drag.before) past.push(drag.before), future = [];
      else if (tool === "line" && !drawn.length) drawn.push(drag.from);
    }
    if (drag?.moved && drag.before) {
      move(pointer[0] - drag.from[0], pointer[1] - drag.from[1]);
      drag.from = pointer;
      refresh(true);
    } else if (!drag && tool === "select") {
      hover(event);
    } else {
      drawMarks();
    }
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
    let best = 8 * width / stage.clientWidth, nearest = null;
    for (const path of event.target.closest("[data-kind], [data-proposal]") ? [] : every) {
      if (hidden.has(path.kind) || !get("paths").checked) continue;
      for (let row = 1; row < path.seen; row++) {
        if (Math.abs(path.xs[row] - pointer[0]) > 60 || Math.abs(path.ys[row] - pointer[1]) > 60) continue;
        const away = distanceTo([[path.xs[row - 1], path.ys[row - 1]], [path.xs[row] + 1e-9, path.ys[row]]], ...pointer);
        if (away < best) [best, nearest] = [away, path];
      }
    }
    if (nearest === hovered) return;
    hovered = nearest;
    const time = seconds => `${Math.floor(seconds / 60)}:${(seconds % 60).toFixed(1).padStart(4, "0")}`;
    say(nearest ? `Vehicle ${nearest.vehicle}: ${nearest.kind}, ${time(nearest.times[0])} to ${time(nearest.times[nearest.seen - 1])}` : HINTS.select);
    drawMarks();
  }

  function type(event) {
    const isField = /INPUT|SELECT|TEXTAREA/.test(event.target.tagName) && event.target.type !== "checkbox";
    const isControl = event.ctrlKey || event.metaKey, key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[key];
    if (isField && (key === "Enter" || key === "Escape")) return stage.focus({ preventScroll: true });
    if (isField || event.altKey) return;
    if (isControl && key === "z") event.shiftKey ? travel(future, past) : travel(past, future);
    else if (isControl && key === "y") travel(future, past);
    else if (isControl && key === "s") save();
    else if (isControl) return;
    else if (KEYS[key]) setTool(KEYS[key]), stage.focus({ preventScroll: true });
    else if (key === "s") swap();
    else if (key === "n" && selected) selected.point = ((selected.point ?? -1) + 1) % pointsOf(selected.kind, item()).length, refresh();
    else if (key === "Delete" || key === "Backspace") drawn.length ? (drawn.pop(), drawMarks()) : remove();
    else if (key === "Escape") drawn.length ? (drawn = [], drawMarks()) : (setTool("select"), choose(null));
    else if (key === "Enter" && tool !== "select") pressEnter();
    else if (arrow) step(...arrow.map(value => value * (event.shiftKey ? 20 : 1)));
    else return;
    event.preventDefault();
  }

  /** Put a point where the crosshair is; where it was just put, the shape ends. */
  function pressEnter() {
    const isPut = drawn.length && String(drawn.at(-1)) === String(pointer);
    if (drawn.length > 2 && (isPut || !pointer)) endShape();
    else putPoint(pointer ?? [width / 2, height / 2]);
  }

  function step(dx, dy) {
    if (tool === "select") return selected ? change(() => move(dx, dy)) : undefined;
    pointer = (pointer ?? [width / 2, height / 2]).map((value, i) => clamp(value + (i ? dy : dx), 0, size[i]));
    drawMarks();
    showLens();
  }

  // ------------------------------------------------ files

  function save() {
    if (get("save").disabled) return say("Mend what is marked first.");
    const address = URL.createObjectURL(new Blob([get("text").textContent], { type: "application/yaml" }));
    el("a", { href: address, download: data.name }).click();
    URL.revokeObjectURL(address);
    saved = JSON.stringify(places);
    say(`Saved as ${data.name}. Use it: vdet detect-video CLIP -c ${data.name}`);
  }

  async function open(event) {
    const [file] = event.target.files;
    event.target.value = "";
    if (!file) return;
    try {
      const read = readYaml(await file.text()), factor = size.map((side, i) => side / read.size[i]);
      if (Math.abs(factor[0] / factor[1] - 1) > 0.01) throw Error("is for frames of another shape");
      const scaled = point => point.map((value, i) => value * factor[i]);
      change(() => {
        places = read.places;
        rest = read.rest;
        places.lines.forEach(line => { line.start = scaled(line.start); line.end = scaled(line.end); });
        [...places.zones, ...places.regions].forEach(each => { if (each.points) each.points = each.points.map(scaled); });
        places.ground.forEach(each => { each.pixel = scaled(each.pixel); });
        [selected, drawn] = [null, []];
      });
      say(`Opened ${file.name}.`);
    } catch (error) {
      say(`${file.name}: ${error.message}`);
    }
  }

  // ------------------------------------------------ start

  stage.style.aspectRatio = `${width} / ${height}`;
  marks.setAttribute("viewBox", `0 0 ${width} ${height}`);
  for (const button of document.querySelectorAll("[data-tool]")) button.addEventListener("click", () => setTool(button.dataset.tool));
  get("undo").addEventListener("click", () => travel(past, future));
  get("redo").addEventListener("click", () => travel(future, past));
  get("save").addEventListener("click", save);
  get("copy").addEventListener("click", () => { getSelection().selectAllChildren(get("text")); document.execCommand("copy"); say("Copied."); });
  get("open").addEventListener("change", open);
  get("paths").addEventListener("change", paintPaths);
  get("classes").replaceChildren(...(kinds.length > 1 ? kinds : []).map(kind => el("label", {}, el("input", { type: "checkbox", checked: "",
    onchange: event => { event.target.checked ? hidden.delete(kind) : hidden.add(kind); paintPaths(); } }), kind)));
  ["→", "↘", "↓", "↙", "←", "↖", "↑", "↗"].forEach((arrow, i) => get("ways").append(el("span", { style: `color: hsl(${45 * i} 90% 45%)` }, arrow)));
  stage.addEventListener("pointerdown", press);
  stage.addEventListener("pointermove", slide);
  stage.addEventListener("pointerup", release);
  stage.addEventListener("pointercancel", () => { drag = null; showLens(); });
  stage.addEventListener("pointerleave", () => { if (!drag) { pointer = hovered = null; drawMarks(); showLens(); } });
  stage.addEventListener("dblclick", endShape);
  addEventListener("keydown", type);
  addEventListener("beforeunload", event => { if (JSON.stringify(places) !== saved) event.preventDefault(); });
  new ResizeObserver(() => { paintPaths(); drawMarks(); }).observe(stage);
  refresh();
  setTool("select");
  document.body.dataset.ready = "yes";
}

if (typeof document !== "undefined")
  openPage(JSON.parse(get("data").textContent)).catch(error => { get("hint").textContent = `This page cannot be shown: ${error.message}`; });
