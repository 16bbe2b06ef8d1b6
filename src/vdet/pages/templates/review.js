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
const clock = seconds => `${Math.floor(seconds / 60)}:${(seconds % 60).toFixed(0).padStart(2, "0")}`;

function element(tag, className, text) {
  const node = document.createElement(tag);
  if (className) node.className = className;
  if (text !== undefined) node.textContent = text;
  return node;
}

/** Return the address of a picture in the page. */
const addressOf = name => `data:image/webp;base64,${get(name).textContent}`;

/** Show the strips of the span; only its pictures are decoded. */
function drawStrips() {
  const { start, end } = spanAt(current);
  const isShown = (from, seconds) => from < end && from + seconds > start;
  const strips = data.pictures.filter(picture => isShown(MINUTE * picture.minute, MINUTE)).map(picture => {
    const band = data.bands[picture.band], strip = element("div", "strip"), columns = element("div", "columns");
    const width = Number(get("size").value), height = picture.height * width / band.samples; // of a column, screen pixels
    const address = `url("${addressOf(`strip-${picture.band}-${picture.minute}`)}")`;
    for (let number = 0; number < picture.columns; number++) {
      const from = MINUTE * picture.minute + number * picture.seconds;
      if (!isShown(from, picture.seconds)) continue;
      const column = element("div", picture.is_upward ? "column up" : "column"), view = element("i");
      column.dataset.at = `${picture.band} ${picture.minute} ${number}`;
      Object.assign(column.style, { width: `${width}px`, height: `${height}px` });
      Object.assign(view.style, { backgroundImage: address, backgroundPosition: `${-number * width}px 0`,
        backgroundSize: `${picture.columns * width}px ${height}px` });
      column.append(view, element("small", "", clock(from)));
      column.onclick = event => {
        if (event.target.closest(".mark")) return;
        const box = column.getBoundingClientRect(), down = (event.clientY - box.top) / box.height;
        const along = picture.is_upward ? 1 - down : down;
        addMissed(picture.band, from + along * picture.seconds,
          Math.round(1000 * (event.clientX - box.left) / box.width) / 1000);
      };
      columns.append(column);
    }
    strip.append(element("h2", "", `${band.name}${picture.is_upward ? " (time runs upwards)" : ""}`), columns);
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

function drawMarks() {
  for (const node of document.querySelectorAll(".mark")) node.remove();
  for (const mark of [...tracesInSpan(), ...inSpan()]) {
    const minute = Math.floor(mark.seconds / MINUTE), isTrace = !mark.key;
    const picture = data.pictures.findLast(item => item.band === mark.band && item.minute <= minute);
    const kinds = isTrace ? ["trace"] : Object.keys(mark.fixes);
    const button = element("button", ["mark", ...kinds, mark.key && mark.key === selected ? "selected" : ""].join(" "), isTrace ? "?" : labelOf(mark));
    if (!isTrace) button.dataset.key = mark.key;
    button.title = `${mark.seconds.toFixed(2)} s, ${isTrace ? "a trace without a vehicle: click to add one" : mark.direction}`;
    button.onclick = () => {
      if (isTrace) return addMissed(mark.band, mark.seconds, mark.position);
      selected = mark.key;
      refresh();
    };
    if (!picture) {
      get("inside").append(button);
      continue;
    }
    const along = (mark.seconds - MINUTE * picture.minute) / picture.seconds;
    const column = Math.min(Math.floor(along), picture.columns - 1), down = along - column;
    Object.assign(button.style, { left: `clamp(36px, ${100 * mark.position}%, calc(100% - 36px))`, top: `${100 * (picture.is_upward ? 1 - down : down)}%` });
    document.querySelector(`[data-at="${picture.band} ${picture.minute} ${column}"]`)?.append(button);
  }
}

function drawDetails() {
  const mark = selectedMark(), box = get("details");
  if (!mark) return box.replaceChildren(element("p", "", "Select a mark, or click on a vehicle without one."));
  const words = { missed: "missed", false: "false: no vehicle", class: "wrong class", direction: "wrong direction" };
  const errors = Object.keys(mark.fixes).map(error => words[error]).join(", ") || "right";
  const title = `${mark.line}, ${clock(mark.seconds)}${mark.id === undefined ? "" : `, id ${mark.id}`}: ${errors}`;
  const button = (text, action, isOn) => {
    const node = element("button", "", text);
    node.setAttribute("aria-pressed", isOn);
    node.onclick = action;
    return node;
  };
  box.replaceChildren(element("h3", "", title),
    button(isMissed(mark) ? "X Remove" : "X False", toggleFalse, "false" in mark.fixes),
    button(`D ${directionOf(mark)}`, turn, "direction" in mark.fixes),
    ...data.classes.map((item, i) => button(`${i < 9 ? i + 1 : ""} ${item}`, () => setClass(item), item === classOf(mark))));
  if (!get(`crop-${mark.id}`)) return;
  const image = element("img");
  image.src = addressOf(`crop-${mark.id}`);
  image.alt = `Best picture of ${mark.id}`;
  box.prepend(image);
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
  const table = element("table", "named"), head = element("tr");
  for (const text of ["line", "class", "counted", "checked", "missed", "false", "wrong class", "wrong direction"]) head.append(element("th", "", text));
  table.append(head);
  for (const values of totals()) {
    const row = element("tr");
    for (const value of values) row.append(element("td", "", value));
    table.append(row);
  }
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
  try {
    localStorage.setItem(data.key, JSON.stringify({ state, current }));
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
  const link = element("a"), file = new Blob([corrections()], { type: "text/yaml" });
  if (file.size > data.limit) {
    get("hint").textContent = `Not saved: the file would have more than ${data.limit} bytes. Review a part: vdet review --start --end.`;
    return;
  }
  link.href = URL.createObjectURL(file);
  link.download = "corrections.yaml";
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
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
get("next").onclick = actions.Enter;
get("back").onclick = actions.ArrowLeft;
get("undo").onclick = undo;
get("save").onclick = save;
get("draw").onclick = draw;
get("open").onclick = () => get("file").click();
get("file").onchange = event => {
  const [file] = event.target.files;
  event.target.value = "";
  if (file) open(file);
};
get("size").oninput = () => refresh(true);
get("reviewer").onchange = event => change(() => { state.reviewer = event.target.value.trim(); });

try {
  const stored = JSON.parse(localStorage.getItem(data.key));
  if (stored) ({ state, current } = stored);
} catch {
  get("hint").textContent = "This browser keeps nothing; save before you close the page.";
}
get("reviewer").value = state.reviewer;
refresh(true);
document.body.dataset.ready = "yes";
