"use strict";
// The page of `vdet review`. A mark is a counted crossing, or a vehicle that was missed. Its fixes say what is wrong:
// false or missed (with null), class or direction (with what is correct). What a person changes is the state: the fixes of
// counted marks by their key, missed vehicles, and the numbers of the checked spans; times are those of a list that was
// opened. Seconds count from the first frame of the video.
const MINUTE = 60;
const data = JSON.parse(document.getElementById("data").textContent);
const get = id => document.getElementById(id);
const spanOf = mark => data.spans.findLast(span => span.start <= mark.seconds)?.number ?? data.spans[0].number;
const numbers = data.spans.map(span => span.number), spanAt = number => data.spans[numbers.indexOf(number)];
let state = data.opened ?? { fixes: {}, times: {}, missed: [], checked: [], reviewer: "", sample: null };
let undone = []; // earlier states, as JSON
let current = numbers[0], selected = null, lastClass = mostFrequent(data.marks.map(mark => mark.class)) ?? data.classes[0];

function mostFrequent(values) {
  const counts = new Map();
  for (const value of values) counts.set(value, (counts.get(value) ?? 0) + 1);
  return [...counts].sort((a, b) => b[1] - a[1])[0]?.[0];
}

// ---------------------------------------------------------------- marks and what a person says of them
/** Return all marks with their fixes. */
function allMarks() {
  const counted = data.marks.map((mark, number) => ({ ...mark, seconds: state.times[`c${number}`] ?? mark.seconds, key: `c${number}`,
    fixes: state.fixes[`c${number}`] ?? {} }));
  return [...counted, ...state.missed.map((mark, number) => ({ ...mark, key: `m${number}`, number, fixes: { missed: null } }))];
}

const isMissed = mark => "missed" in mark.fixes;
const classOf = mark => mark.fixes.class ?? mark.class;
const directionOf = mark => mark.fixes.direction ?? mark.direction;
const selectedMark = () => allMarks().find(mark => mark.key === selected);

/** Change the state by a function, so that it can be undone and survives a reload. */
function change(edit) {
  undone.push(JSON.stringify(state));
  if (undone.length > 500) undone.shift();
  edit();
  refresh();
}

/** Return the counted marks of the same visit to a zone: both its ends are false, or none. */
function visitOf(mark) {
  const ends = allMarks().filter(other => !isMissed(other) && other.vehicle === mark.vehicle && other.line === mark.line);
  const at = ends.findIndex(other => other.key === mark.key), isEntry = name => ["enter", "appear"].includes(name);
  if (!data.zones.includes(mark.line)) return [mark];
  return [mark, ends[isEntry(mark.direction) ? at + 1 : at - 1]].filter(end => end === mark || end && isEntry(end.direction) !== isEntry(mark.direction));
}

function toggleFalse() {
  const mark = selectedMark();
  if (!mark) return;
  if (isMissed(mark)) selected = null;
  change(() => {
    if (isMissed(mark)) state.missed.splice(mark.number, 1);
    else for (const { key } of visitOf(mark)) state.fixes[key] = "false" in mark.fixes ? {} : { false: null };
  });
}

/** Correct the class or the direction of the selected mark: the class of its vehicle, at all lines. */
function correct(name, value) {
  const mark = selectedMark();
  if (!mark) return;
  const isFixed = other => other.key === mark.key || name === "class" && other.vehicle === mark.vehicle && !("false" in other.fixes);
  change(() => {
    if (isMissed(mark)) {
      state.missed[mark.number][name] = value;
      return;
    }
    for (const { key, fixes: { false: _, ...fixes }, ...counted } of allMarks().filter(other => !isMissed(other) && isFixed(other))) {
      if (value === counted[name]) delete fixes[name];
      else fixes[name] = value;
      state.fixes[key] = fixes;
    }
  });
}

function setClass(name) {
  lastClass = name;
  correct("class", name);
}

function turn() {
  const mark = selectedMark(), opposite = mark && data.bands[mark.band]?.directions.find(name => name !== directionOf(mark));
  if (opposite) correct("direction", opposite);
}

/** Add a vehicle that was missed; its direction is that of the nearest marks at the line. */
function addMissed(band, seconds, position) {
  const near = data.marks.filter(mark => mark.band === band)
    .sort((a, b) => Math.abs(a.position - position) - Math.abs(b.position - position)).slice(0, 5);
  const direction = mostFrequent(near.map(mark => mark.direction)) ?? data.bands[band].directions[0];
  selected = `m${state.missed.length}`;
  change(() => state.missed.push({ band, seconds: rounded(Math.min(Math.max(seconds, data.spans[0].start), data.spans.at(-1).end)), position, line: data.bands[band].name,
    direction, class: lastClass }));
}

function undo() {
  if (!undone.length) return;
  state = JSON.parse(undone.pop());
  if (!selectedMark()) selected = null;
  refresh();
}

/** Return the numbers of the spans to check: all, or those of the sample in the order in which they were drawn. */
const planned = () => state.sample?.spans ?? numbers;

function draw() {
  const count = Math.min(numbers.length, Number(get("count").value));
  change(() => {
    state.sample = count >= 1 ? { seed: data.seed, spans: data.order.slice(0, count) } : null;
    if (!planned().includes(current)) [current, selected] = [planned()[0], null];
  });
}

function go(steps, isChecked) {
  const next = planned()[planned().indexOf(current) + steps], checked = current;
  if (next !== undefined) {
    [current, selected] = [next, null];
    scrollTo(0, 0);
  }
  if (isChecked && !state.checked.includes(checked)) change(() => state.checked.push(checked));
  else refresh();
}

// ---------------------------------------------------------------- the view
const counted = (number, noun) => `${number} ${noun}${number === 1 ? "" : "s"}`;
/** Return a time in the video, or of its clock. */
function clock(seconds) {
  const time = Math.round(seconds + (data.clock ?? 0)), pad = number => String(number).padStart(2, "0"), minutes = Math.floor(time / 60);
  const hours = Math.floor(minutes / 60) % (data.clock === null ? Infinity : 24);
  return `${hours || data.clock !== null ? `${hours}:${pad(minutes % 60)}` : minutes}:${pad(time % 60)}`;
}

function element(tag, className, ...children) {
  const node = document.createElement(tag);
  if (className) node.className = className;
  node.append(...children);
  return node;
}

/** Return the address of a picture in the page. */
const addressOf = name => `data:image/webp;base64,${get(name).textContent}`;

const LEAST = 400, MOST = 640; // pixels of a line on the screen, if the window is wide enough
const GAP = 12, MARGIN = 92, LABEL = 18; // between columns; beside a strip, for labels; height of a label

/** Return how large the picture of a column is; `number` is that of all columns. */
function sizeOf(picture, number) {
  const across = data.bands[picture.band].samples, room = get("strips").clientWidth;
  if (picture.way === "right") return { width: room, height: Math.max(LEAST, Math.round(across * room / picture.rows)) };
  const beside = Math.max(1, Math.min(number, Math.floor((room + GAP) / (LEAST + MARGIN + GAP))));
  const width = Math.min(MOST, Math.floor((room - (beside - 1) * GAP) / beside) - MARGIN);
  return { width, height: Math.round(picture.rows * width / across) };
}

/** Return where a time is in a column of a picture, and a position along the line: from 0 to 1, from the left and the top. */
function placeIn({ band, way, minute, seconds, lead }, number, time, position) {
  const { start, end } = data.bands[band], along = (time - MINUTE * minute - number * seconds + lead) / (seconds + lead);
  if (way === "right") return { x: along, y: start[1] < end[1] ? position : 1 - position };
  return { x: position, y: way === "up" ? 1 - along : along };
}

/** Return the time and the position at a point of a column, the reverse of `placeIn`. */
function pointIn({ band, way, minute, seconds, lead }, number, x, y) {
  const { start, end } = data.bands[band], along = way === "right" ? x : way === "up" ? 1 - y : y;
  const position = way !== "right" ? x : start[1] < end[1] ? y : 1 - y;
  return { time: MINUTE * minute + number * seconds - lead + along * (seconds + lead), position: rounded(position) };
}

/** Show the strips of the span; only its pictures are decoded. */
function drawStrips() {
  const { start, end } = spanAt(current);
  const isShown = (from, seconds) => from < end && from + seconds > start;
  const columnsOf = ({ columns, minute, seconds }) => [...Array(columns).keys()].filter(number => isShown(MINUTE * minute + number * seconds, seconds));
  const pictures = data.pictures.filter(picture => columnsOf(picture).length), every = pictures.flatMap(columnsOf).length;
  const strips = pictures.map(picture => {
    const band = data.bands[picture.band], strip = element("div", "strip"), columns = element("div", `columns ${picture.way}`);
    const { width, height } = sizeOf(picture, every), isRight = picture.way === "right";
    const address = `url("${addressOf(`strip-${picture.band}-${picture.minute}`)}")`;
    for (const number of columnsOf(picture)) {
      const from = MINUTE * picture.minute + number * picture.seconds, view = element("i", "", element("b"));
      const column = element("div", "column", element("small", "", clock(from)), view, element("small", "", clock(from + picture.seconds)));
      column.dataset.at = `${picture.band} ${picture.minute} ${number}`;
      Object.assign(view.style, { width: `${width}px`, height: `${height}px`, backgroundImage: address,
        backgroundPosition: isRight ? `0 ${-number * height}px` : `${-number * width}px 0`,
        backgroundSize: isRight ? `${width}px ${picture.columns * height}px` : `${picture.columns * width}px ${height}px` });
      view.style.setProperty("--lead", `${100 * picture.lead / (picture.seconds + picture.lead)}%`);
      view.onclick = event => {
        const box = view.getBoundingClientRect();
        const { time, position } = pointIn(picture, number, (event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
        if (time >= from) addMissed(picture.band, time, position); // else it is in the column before
      };
      columns.append(column);
    }
    strip.append(element("h2", "", `${band.name} (time runs ${{ right: "from left to right", up: "upwards", down: "down" }[picture.way]})`), columns);
    return strip;
  });
  get("strips").replaceChildren(...strips);
}

const inSpan = () => allMarks().filter(mark => spanOf(mark) === current)
  .sort((a, b) => a.band - b.band || a.seconds - b.seconds);

function labelOf(mark) {
  const directions = data.bands[mark.band]?.directions, arrow = directionOf(mark) === directions?.[0] ? "◁" : "▷";
  const way = directions ? arrow : `${mark.line} ${clock(mark.seconds)}: ${mark.direction}`;
  return `${way} ${classOf(mark)}${mark.id === undefined ? " +" : ` ${mark.id}`}`;
}

/** Return the traces of the span at which no vehicle was added. */
const tracesInSpan = () => data.traces.map(trace => ({ ...trace, seconds: trace.time })).filter(trace =>
  spanOf(trace) === current && !state.missed.some(mark => mark.band === trace.band
    && Math.abs(mark.seconds - trace.seconds) < 1 && Math.abs(mark.position - trace.position) < 0.1));

/** Show marks in margins beside the strips, where none covers another or a vehicle, with thin lines to the feet. */
function drawMarks() {
  for (const node of document.querySelectorAll(".mark, .feet")) node.remove();
  const columns = new Map();
  for (const mark of [...tracesInSpan(), ...inSpan()]) {
    const minute = Math.floor(mark.seconds / MINUTE), isTrace = !mark.key;
    const picture = data.pictures.findLast(item => item.band === mark.band && item.minute <= minute);
    const kinds = [...(isTrace ? ["trace"] : Object.keys(mark.fixes)), mark.key && mark.key === selected ? "selected" : ""].join(" ");
    const button = element("button", `mark ${kinds}`, isTrace ? "? trace" : labelOf(mark));
    if (!isTrace) button.dataset.key = mark.key;
    button.title = `${clock(mark.seconds)}, ${isTrace ? "a trace without a vehicle: click to add one" : `${classOf(mark)}, ${directionOf(mark)}`}`;
    button.onclick = () => {
      if (isTrace) return addMissed(mark.band, mark.seconds, mark.position);
      selected = mark.key;
      refresh();
    };
    if (!picture) {
      get("inside").append(button);
      continue;
    }
    const number = Math.min(Math.floor((mark.seconds - MINUTE * picture.minute) / picture.seconds), picture.columns - 1);
    const column = document.querySelector(`[data-at="${picture.band} ${picture.minute} ${number}"]`);
    if (column) columns.set(column, [...columns.get(column) ?? [], { button, kinds, ...placeIn(picture, number, mark.seconds, mark.position) }]);
  }
  for (const [column, marks] of columns) placeMarks(column, marks);
}

function placeMarks(column, marks) {
  const view = column.querySelector("i"), { offsetWidth: width, offsetHeight: height } = view;
  const isRight = column.parentElement.matches(".right"), rows = []; // where the labels of each row above a strip end
  marks.sort((a, b) => isRight ? a.x - b.x : a.y - b.y);
  let low = 0;
  for (const [n, mark] of marks.entries()) {
    if (isRight) {
      mark.left = Math.min(Math.max(0, mark.x * width - MARGIN / 2), width - MARGIN);
      const free = rows.findIndex(end => end <= mark.left), row = free < 0 ? rows.length : free;
      rows[row] = mark.left + MARGIN;
      mark.top = -LABEL * (row + 1) - 4;
      mark.from = [mark.left + MARGIN / 2, mark.top + LABEL];
    } else {
      mark.top = Math.max(low, Math.min(mark.y * height - LABEL / 2, height - LABEL * (marks.length - n))); // leaves room for others
      low = mark.top + LABEL;
      mark.left = width + 8;
      mark.from = [mark.left, mark.top + LABEL / 2];
    }
  }
  if (isRight) view.style.marginTop = `${rows.length * LABEL + 4}px`;
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg"), { offsetLeft, offsetTop } = view;
  svg.setAttribute("class", "feet");
  for (const { button, kinds, x, y, left, top, from } of marks) {
    Object.assign(button.style, { left: `${offsetLeft + left}px`, top: `${offsetTop + top}px` });
    const line = svg.appendChild(document.createElementNS(svg.namespaceURI, "path"));
    line.setAttribute("d", `M${offsetLeft + from[0]} ${offsetTop + from[1]} L${offsetLeft + x * width} ${offsetTop + y * height}`);
    line.setAttribute("class", kinds);
    column.append(button);
  }
  column.append(svg);
}

function drawDetails() {
  const mark = selectedMark(), box = get("details");
  if (!mark) return box.replaceChildren(element("p", "", "Select a mark, or click on a vehicle without one."));
  const words = { missed: "missed", false: "false: no vehicle", class: "wrong class", direction: "wrong direction" };
  const errors = Object.keys(mark.fixes).map(error => words[error]).join(", ") || "right";
  const title = `${mark.line}, ${clock(mark.seconds)}${mark.id === undefined ? "" : `, id ${mark.id}`}: ${errors}`;
  const button = (text, onclick, ariaPressed) => Object.assign(element("button", "", text), { onclick, ariaPressed });
  box.replaceChildren(element("h3", "", title),
    button(isMissed(mark) ? "X Remove" : "X False", toggleFalse, "false" in mark.fixes),
    button(`D ${directionOf(mark)}`, turn, "direction" in mark.fixes),
    ...data.classes.map((item, i) => button(`${i < 9 ? i + 1 : ""} ${item}`, () => setClass(item), item === classOf(mark))));
  const shown = [["crop", `crop-${mark.id}`, `Best picture of ${mark.id}`], ["moment", mark.moment, "The frame when it crosses"]];
  for (const [kind, name, alt] of shown.filter(([, id]) => id && get(id)))
    box.prepend(Object.assign(element("img", kind), { alt, src: addressOf(name) }));
}

const ERRORS = ["missed", "false", "class", "direction"];

/** Return the rows of the table: line, class, counted, of these in checked spans, and the number of each error. */
function totals() {
  const rows = new Map();
  for (const mark of allMarks()) {
    for (const group of ["all", mark.class]) {
      const name = JSON.stringify([mark.line, group]), row = rows.get(name) ?? [mark.line, group, 0, 0, 0, 0, 0, 0];
      rows.set(name, row);
      if (!isMissed(mark)) row[2]++;
      if (!isMissed(mark) && state.checked.includes(spanOf(mark))) row[3]++;
      for (const error of Object.keys(mark.fixes)) row[4 + ERRORS.indexOf(error)]++;
    }
  }
  return [...rows.values()].sort((a, b) => a[0].localeCompare(b[0]) || b[2] - a[2]);
}

function drawSummary() {
  const row = (tag, values) => element("tr", "", ...values.map(value => element(tag, "", value)));
  const headings = ["line", "class", "counted", "checked", "missed", "false", "class", "direction"];
  const table = element("table", "named", row("th", headings), ...totals().map(values => row("td", values)));
  get("summary").replaceChildren(element("p", "", sentence()), table);
}

/** Return the sentence for a report: what was checked, and how right the counts are there. */
function sentence() {
  const done = planned().filter(item => state.checked.includes(item)).length;
  const marks = allMarks().filter(mark => mark.band !== null && state.checked.includes(spanOf(mark)));
  const passed = marks.filter(mark => !("false" in mark.fixes)), seen = passed.filter(mark => !isMissed(mark));
  const parts = [`Checked ${done} of ${counted(planned().length, "span")}`];
  if (passed.length) parts[0] += `: ${(100 * seen.length / passed.length).toFixed(1)} % counted, ${marks.length - passed.length} false`;
  for (const name of new Set(seen.map(classOf))) {
    const vehicles = seen.filter(mark => classOf(mark) === name), right = vehicles.filter(mark => !mark.fixes.class).length;
    if (right < vehicles.length) parts.push(`${name}: ${right} of ${vehicles.length} named right`);
  }
  return `${parts.join("; ")}.`;
}

/** Show the estimate of the true count by the checked spans of the sample: of all, by line and direction, and by class. */
function drawEstimate() {
  const table = new Map(), none = () => data.spans.map(() => 0);
  const groups = (mark, direction, name) => [ALL, `${mark.line}, ${direction}`, name];
  const of = group => table.get(group) ?? table.set(group, [none(), none(), none()]).get(group);
  [ALL, ...data.bands.flatMap(band => band.directions.map(direction => `${band.name}, ${direction}`))].forEach(of);
  for (const mark of allMarks().filter(item => item.band !== null)) {
    const before = isMissed(mark) ? [] : groups(mark, mark.direction, mark.class), span = numbers.indexOf(spanOf(mark));
    const after = "false" in mark.fixes ? [] : groups(mark, directionOf(mark), classOf(mark));
    for (const group of before) of(group)[0][span]++;
    for (const group of after.filter(name => !before.includes(name))) of(group)[1][span]++;
    for (const group of before.filter(name => !after.includes(name))) of(group)[2][span]++;
  }
  const indices = list => new Set(list.map(number => numbers.indexOf(number)));
  const rows = estimateCounts({ numbers: table, strata: data.strata, checked: indices(state.checked),
    drawn: indices(state.sample?.spans ?? []) });
  const text = row => `${row.group}: ${row.counted} counted, ${row.corrected} corrected, ${Math.round(row.true)} estimated ` +
    `(95 %: ${Math.round(row.low)} to ${Math.round(row.high)})` + (row.minutesToPrecision ? `; ${counted(row.minutesToPrecision, "more span")} for ± 2 %` : "");
  const words = state.sample ? "The estimate needs three checked spans of the sample." : "Draw a sample for an estimate of the true count.";
  get("estimate").replaceChildren(...(rows.length ? rows.map(row => element("p", "", text(row))) : [element("p", "", words)]));
}

/** Show the state, and keep it for a reload. */
function refresh(isNew = false) {
  if (isNew || get("strips").dataset.span !== String(current)) drawStrips();
  get("strips").dataset.span = current;
  get("minute").textContent = `${clock(spanAt(current).start)} to ${clock(spanAt(current).end)}${state.checked.includes(current) ? " ✓" : ""}`;
  get("back").disabled = current === planned()[0];
  get("undo").disabled = !undone.length;
  drawMarks();
  drawDetails();
  drawSummary();
  drawEstimate();
  withStorage(storage => storage.setItem(data.key, JSON.stringify({ state, current })));
}

function withStorage(use) {
  try {
    use(localStorage);
  } catch {
    get("hint").textContent = "This browser keeps nothing; save before you close the page.";
  }
}

// ---------------------------------------------------------------- the file
const rounded = seconds => Math.round(1000 * seconds) / 1000;
const json = value => escaped(JSON.stringify(value));
const NEAR = 1; // seconds around checked spans and errors in which the marks are listed, so that each is known again

/** Return the checked spans in seconds from the first frame, joined where they touch. */
function spans() {
  const joined = [];
  for (const { start, end } of data.spans.filter(span => state.checked.includes(span.number))) {
    if (joined.at(-1)?.[1] === start) joined.at(-1)[1] = end;
    else joined.push([start, end]);
  }
  return joined;
}

/** Return what the file says of a mark: what was counted, and all that is wrong of it. */
function eventOf(mark) {
  const errors = Object.keys(mark.fixes), correct = Object.values(mark.fixes).filter(value => value !== null);
  return { line: mark.line, time: rounded(mark.seconds), direction: mark.direction, class: mark.class, id: mark.id,
    error: errors.length ? errors : undefined, correct: correct.length ? correct : undefined };
}

/** Return corrections.yaml: JSON, which is YAML, with an event a line. */
function corrections() {
  const names = [...new Set(data.bands.map(band => band.name))];
  const checked = names.flatMap(line => spans().map(([start, end]) =>
    ({ line, start, end, complete: true })));
  const wrong = allMarks().filter(mark => Object.keys(mark.fixes).length).map(mark => mark.seconds);
  const listed = [...spans(), ...wrong.map(seconds => [seconds, seconds])];
  const events = allMarks().filter(mark => listed.some(([start, end]) => mark.seconds >= start - NEAR && mark.seconds <= end + NEAR))
    .sort((a, b) => a.seconds - b.seconds).map(eventOf);
  const file = { ...data.head, reviewer: state.reviewer || null, saved: new Date().toISOString(), sample: state.sample, checked, events };
  const lines = Object.entries(file).map(([name, value]) => {
    const items = Array.isArray(value) && typeof value[0] === "object" ? `[\n    ${value.map(json).join(",\n    ")}]` : json(value);
    return `  ${json(name)}: ${items}`;
  });
  return `{\n${lines.join(",\n")}\n}\n`;
}

/** Return the state of a file that this page has saved, or another one of the same tracks. */
function stateOf(file) {
  const opened = { fixes: {}, times: {}, missed: [], reviewer: file.reviewer ?? "", sample: file.sample ?? null };
  if (JSON.stringify(file.lines) !== JSON.stringify(data.head.lines) || file.video !== data.head.video) throw new Error("is of another video, or of other lines");
  opened.checked = data.spans.filter(span => data.bands.every(band => file.checked.some(item => item.complete && item.line === band.name &&
    item.start <= span.start + 0.001 && item.end >= span.end - 0.001))).map(span => span.number);
  for (const event of file.events) {
    const errors = event.error ?? [], seconds = rounded(event.time);
    if (errors.includes("missed")) {
      const band = data.bands.findIndex(item => item.name === event.line && item.directions.includes(event.direction));
      opened.missed.push({ band, seconds, position: 0.5, line: event.line, direction: event.direction, class: event.class });
      continue;
    }
    const number = data.marks.findIndex(mark => mark.id === event.id && mark.line === event.line && mark.direction === event.direction &&
      Math.abs(mark.seconds - seconds) < 0.5);
    if (number < 0) throw new Error("is of other tracks: open it with vdet review --corrections");
    opened.fixes[`c${number}`] = Object.fromEntries(errors.map((error, at) => [error, event.correct?.[at] ?? null]));
    opened.times[`c${number}`] = seconds;
  }
  return opened;
}

async function open(file) {
  try {
    const opened = stateOf(JSON.parse(await file.text()));
    change(() => { state = opened; });
    get("reviewer").value = state.reviewer;
    get("hint").textContent = `${file.name} was opened.`;
  } catch (error) {
    get("hint").textContent = `${file.name} ${error instanceof SyntaxError ? "was not saved by this page: open it with vdet review --corrections" : error.message}.`;
  }
}

function save() {
  const file = new Blob([corrections()], { type: "text/yaml" });
  if (file.size > data.limit) {
    get("hint").textContent = `Not saved: the file would have more than ${data.limit} bytes. Review a part: vdet review --start --end.`;
    return;
  }
  const href = URL.createObjectURL(file);
  Object.assign(element("a"), { href, download: "corrections.yaml" }).click();
  setTimeout(() => URL.revokeObjectURL(href), 10000);
  get("hint").textContent = "corrections.yaml was saved; pass it to vdet count --corrections.";
}

// ---------------------------------------------------------------- keys, and the start
function nextMark(step) {
  const marks = inSpan(), at = marks.findIndex(mark => mark.key === selected);
  if (!marks.length) return;
  selected = marks[at < 0 ? (step > 0 ? 0 : marks.length - 1) : (at + step + marks.length) % marks.length].key;
  refresh();
  document.querySelector(".mark.selected")?.scrollIntoView({ block: "nearest" });
}

const actions = { Enter: () => go(1, true), ArrowRight: () => go(1, false), ArrowLeft: () => go(-1, false), x: toggleFalse,
  d: turn, z: undo, s: save, Escape: () => { selected = null; refresh(); } };

document.addEventListener("keydown", event => {
  const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (event.target.matches("input:not([type=file])")) return;
  if (name === "Tab") nextMark(event.shiftKey ? -1 : 1);
  else if (/^[1-9]$/.test(name) && data.classes[name - 1]) setClass(data.classes[name - 1]);
  else if (actions[name] && !event.altKey) actions[name]();
  else return;
  event.preventDefault();
});
const buttons = { next: actions.Enter, back: actions.ArrowLeft, undo, save, draw, open: () => get("file").click() };
for (const [id, action] of Object.entries(buttons)) get(id).onclick = action;
get("file").onchange = event => {
  const [file] = event.target.files;
  event.target.value = "";
  if (file) open(file);
};
addEventListener("resize", () => refresh(true));
get("reviewer").onchange = event => change(() => { state.reviewer = event.target.value.trim(); });

withStorage(storage => ({ state, current } = JSON.parse(storage.getItem(data.key)) ?? { state, current }));
get("reviewer").value = state.reviewer;
get("scene").src = addressOf("scene-picture");
refresh(true);
document.body.dataset.ready = "yes";
