"use strict";
// The page of `vdet review`. A mark is a counted crossing, or a vehicle that was missed. Its fixes say what is wrong:
// false or missed (with null), class or direction (with what is correct). What a person changes is the state: the fixes of
// counted marks by their key, missed vehicles, and the checked minutes. Seconds count from the first frame of the video.
const MINUTE = 60;
const data = JSON.parse(document.getElementById("data").textContent);
const get = id => document.getElementById(id);
const minuteOf = mark => Math.floor(mark.seconds / MINUTE);
let state = { fixes: {}, missed: [], checked: [], reviewer: "", sample: null };
let undone = []; // earlier states, as JSON
let minute = data.minutes[0] ?? 0, selected = null, lastClass = mostFrequent(data.marks.map(mark => mark.class)) ?? data.classes[0];

function mostFrequent(values) {
  const counts = new Map();
  for (const value of values) counts.set(value, (counts.get(value) ?? 0) + 1);
  return [...counts].sort((a, b) => b[1] - a[1])[0]?.[0];
}

// ---------------------------------------------------------------- marks and what a person says of them
/** Return all marks with their fixes. */
function allMarks() {
  const counted = data.marks.map((mark, number) => ({ ...mark, key: `c${number}`, fixes: state.fixes[`c${number}`] ?? {} }));
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

function toggleFalse() {
  const mark = selectedMark();
  if (!mark) return;
  if (isMissed(mark)) selected = null;
  change(() => {
    if (isMissed(mark)) state.missed.splice(mark.number, 1);
    else state.fixes[mark.key] = "false" in mark.fixes ? {} : { false: null };
  });
}

/** Correct the class or the direction of the selected mark. */
function correct(name, value) {
  const mark = selectedMark();
  if (!mark) return;
  const { false: _, ...fixes } = { ...mark.fixes, [name]: value };
  if (value === mark[name]) delete fixes[name];
  change(() => {
    if (isMissed(mark)) state.missed[mark.number][name] = value;
    else state.fixes[mark.key] = fixes;
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
  const rounded = Math.round(1000 * seconds) / 1000;
  change(() => state.missed.push({ band, seconds: rounded, position, line: data.bands[band].name,
    direction, class: lastClass }));
}

function undo() {
  if (!undone.length) return;
  state = JSON.parse(undone.pop());
  if (!selectedMark()) selected = null;
  refresh();
}

/** Return the minutes to check: all, or those of the sample in the order in which they were drawn. */
const planned = () => state.sample?.minutes ?? data.minutes;

function draw() {
  const count = Math.min(data.minutes.length, Number(get("count").value));
  change(() => {
    state.sample = count >= 1 ? { seed: data.seed, minutes: data.order.slice(0, count) } : null;
    if (!planned().includes(minute)) [minute, selected] = [planned()[0], null];
  });
}

function go(steps, isChecked) {
  const next = planned()[planned().indexOf(minute) + steps], checked = minute;
  if (next !== undefined) {
    [minute, selected] = [next, null];
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

/** Show the strips of the minute; only its pictures are decoded. */
function drawStrips() {
  const strips = data.pictures.filter(picture => picture.minute === minute).map(picture => {
    const band = data.bands[picture.band], strip = element("div", "strip"), columns = element("div", "columns");
    const width = Number(get("size").value), height = picture.height * width / band.samples; // of a column, screen pixels
    const address = `url("${addressOf(`strip-${picture.band}-${picture.minute}`)}")`;
    columns.dataset.band = picture.band;
    for (let number = 0; number < picture.columns; number++) {
      const column = element("div", picture.is_upward ? "column up" : "column"), view = element("i");
      Object.assign(column.style, { width: `${width}px`, height: `${height}px` });
      Object.assign(view.style, { backgroundImage: address, backgroundPosition: `${-number * width}px 0`,
        backgroundSize: `${picture.columns * width}px ${height}px` });
      column.append(view, element("small", "", clock(MINUTE * minute + number * picture.seconds)));
      column.onclick = event => {
        if (event.target.closest(".mark")) return;
        const box = column.getBoundingClientRect(), down = (event.clientY - box.top) / box.height;
        const along = picture.is_upward ? 1 - down : down;
        addMissed(picture.band, MINUTE * minute + (number + along) * picture.seconds,
          Math.round(1000 * (event.clientX - box.left) / box.width) / 1000);
      };
      columns.append(column);
    }
    strip.append(element("h2", "", `${band.name}${picture.is_upward ? " (time runs upwards)" : ""}`), columns);
    return strip;
  });
  get("strips").replaceChildren(...strips);
}

const inMinute = () => allMarks().filter(mark => minuteOf(mark) === minute)
  .sort((a, b) => a.band - b.band || a.seconds - b.seconds);

function labelOf(mark) {
  const directions = data.bands[mark.band]?.directions, arrow = directionOf(mark) === directions?.[0] ? "◁" : "▷";
  const way = directions ? arrow : `${mark.line} ${clock(mark.seconds)}: ${mark.direction}`;
  return `${way} ${classOf(mark)}${mark.id === undefined ? " +" : ` ${mark.id}`}`;
}

/** Return the traces of the minute at which no vehicle was added. */
const tracesInMinute = () => data.traces.map(trace => ({ ...trace, seconds: trace.time })).filter(trace =>
  minuteOf(trace) === minute && !state.missed.some(mark => mark.band === trace.band
    && Math.abs(mark.seconds - trace.seconds) < 1 && Math.abs(mark.position - trace.position) < 0.1));

function drawMarks() {
  for (const node of document.querySelectorAll(".mark")) node.remove();
  for (const mark of [...tracesInMinute(), ...inMinute()]) {
    const picture = data.pictures.find(item => item.band === mark.band && item.minute === minute), isTrace = !mark.key;
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
    const along = (mark.seconds - MINUTE * minute) / picture.seconds;
    const column = Math.min(Math.floor(along), picture.columns - 1), down = along - column;
    Object.assign(button.style, { left: `clamp(36px, ${100 * mark.position}%, calc(100% - 36px))`, top: `${100 * (picture.is_upward ? 1 - down : down)}%` });
    document.querySelector(`.columns[data-band="${mark.band}"]`).children[column].append(button);
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

/** Return the rows of the table: line, class, counted, of these in checked minutes, and the number of each error. */
function totals() {
  const rows = new Map();
  for (const mark of allMarks()) {
    for (const group of ["all", mark.class]) {
      const name = JSON.stringify([mark.line, group]), row = rows.get(name) ?? [mark.line, group, 0, 0, 0, 0, 0, 0];
      rows.set(name, row);
      if (!isMissed(mark)) row[2]++;
      if (!isMissed(mark) && state.checked.includes(minuteOf(mark))) row[3]++;
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
  const marks = allMarks().filter(mark => state.checked.includes(minuteOf(mark)));
  const passed = marks.filter(mark => !("false" in mark.fixes)), seen = passed.filter(mark => !isMissed(mark));
  const parts = [`Checked ${done} of ${counted(planned().length, "minute")}`];
  if (passed.length) parts[0] += `: ${(100 * seen.length / passed.length).toFixed(1)} % counted, ${marks.length - passed.length} false`;
  for (const name of new Set(seen.map(classOf))) {
    const vehicles = seen.filter(mark => classOf(mark) === name), right = vehicles.filter(mark => !mark.fixes.class).length;
    if (right < vehicles.length) parts.push(`${name}: ${right} of ${vehicles.length} named right`);
  }
  return `${parts.join("; ")}.`;
}

/** Show the estimate of the true count by the checked minutes of the sample. */
function drawEstimate() {
  const errors = allMarks().filter(mark => Object.keys(mark.fixes).length && state.checked.includes(minuteOf(mark)))
    .map(mark => ({ minute: data.minutes.indexOf(minuteOf(mark)), counted: isMissed(mark) ? null : mark.class,
      true: "false" in mark.fixes ? null : classOf(mark) }));
  const indices = list => new Set(list.map(item => data.minutes.indexOf(item)));
  const rows = estimateCounts({ counted: data.counted, strata: data.strata, errors, checked: indices(state.checked),
    drawn: indices(state.sample?.minutes ?? []) });
  const text = row => `${row.group ?? "all"}: ${row.counted} counted, ${Math.round(row.true)} true ` +
    `(${Math.round(row.low)} to ${Math.round(row.high)})` + (row.minutesToPrecision ? `; ${counted(row.minutesToPrecision, "more minute")} for ± 2 %` : "");
  const words = state.sample ? "The estimate needs three checked minutes of the sample." : "Draw a sample for an estimate of the true count.";
  get("estimate").replaceChildren(...(rows.length ? rows.map(row => element("p", "", text(row))) : [element("p", "", words)]));
}

/** Show the state, and keep it for a reload. */
function refresh(isNew = false) {
  if (isNew || get("strips").dataset.minute !== String(minute)) drawStrips();
  get("strips").dataset.minute = minute;
  get("minute").textContent = `${clock(MINUTE * minute)} to ${clock(MINUTE * minute + MINUTE)}${state.checked.includes(minute) ? " ✓" : ""}`;
  get("back").disabled = minute === planned()[0];
  get("undo").disabled = !undone.length;
  drawMarks();
  drawDetails();
  drawSummary();
  drawEstimate();
  try {
    localStorage.setItem(data.key, JSON.stringify({ state, minute }));
  } catch {
    get("hint").textContent = "This browser keeps nothing; save before you close the page.";
  }
}

// ---------------------------------------------------------------- the file
const quoted = text => escaped(JSON.stringify(String(text)));
const pair = point => `[${point.map(value => Math.round(100 * value) / 100).join(", ")}]`;

function now() {
  const date = new Date(), pad = value => String(Math.abs(value)).padStart(2, "0"), offset = -date.getTimezoneOffset();
  const day = [date.getFullYear(), pad(date.getMonth() + 1), pad(date.getDate())].join("-");
  const time = [date.getHours(), date.getMinutes(), date.getSeconds()].map(pad).join(":");
  return `${day} ${time}${offset < 0 ? "-" : "+"}${pad(Math.trunc(offset / 60))}:${pad(offset % 60)}`;
}

/** Return the checked spans in seconds from the first frame, joined where they touch. */
function spans() {
  const joined = [];
  for (const number of [...state.checked].sort((a, b) => a - b)) {
    if (joined.at(-1)?.[1] === MINUTE * number) joined.at(-1)[1] += MINUTE;
    else joined.push([MINUTE * number, MINUTE * (number + 1)]);
  }
  return joined;
}

/** Return the line of the file for a mark, with all that is wrong of it. */
function eventLine(mark) {
  const time = mark.seconds, errors = Object.keys(mark.fixes);
  const correct = errors.map(error => mark.fixes[error]).filter(value => value !== null);
  const parts = [`line: ${quoted(mark.line)}`, `time: ${time}`, `direction: ${quoted(mark.direction)}`, `class: ${quoted(mark.class)}`];
  const words = values => values.length > 1 ? `[${values.map(quoted).join(", ")}]` : quoted(values[0]);
  if (mark.id !== undefined) parts.push(`id: ${mark.id}`);
  if (errors.length) parts.push(`error: ${words(errors)}`);
  if (correct.length) parts.push(`correct: ${words(correct)}`);
  return `  - {${parts.join(", ")}}`;
}

function list(name, items) {
  return items.length ? [`${name}:`, ...items] : [`${name}: []`];
}

/** Return corrections.yaml. */
function corrections() {
  const lines = data.lines.map(line => `  - {name: ${quoted(line.name)}, start: ${pair(line.start)}, end: ${pair(line.end)}, ` +
    `left: ${quoted(line.left)}, right: ${quoted(line.right)}}`);
  const zones = data.zones.map(zone => `  - {name: ${quoted(zone.name)}, points: [${zone.points.map(pair).join(", ")}]}`);
  const names = [...new Set(data.bands.map(band => band.name))];
  const checked = names.flatMap(name => spans().map(([start, end]) => `  - {line: ${quoted(name)}, start: ${start}, end: ${end}}`));
  const isWrong = mark => Object.keys(mark.fixes).length > 0;
  const complete = spans().concat(allMarks().filter(isWrong).map(mark => [mark.seconds, mark.seconds]));
  const isListed = mark => isWrong(mark) || complete.some(([start, end]) => mark.seconds > start - 1 && mark.seconds < end + 1);
  const events = allMarks().filter(isListed).sort((a, b) => a.seconds - b.seconds).map(eventLine);
  const sample = state.sample ? `{seed: ${state.sample.seed}, minutes: [${state.sample.minutes.join(", ")}]}` : "null";
  return [`video: ${quoted(data.video)}`, `size: [${data.size.join(", ")}]`, ...list("lines", lines), ...list("zones", zones),
    `reviewer: ${state.reviewer ? quoted(state.reviewer) : "null"}`, `saved: ${now()}`, `sample: ${sample}`,
    ...list("checked", checked), ...list("events", events), ""].join("\n");
}

function save() {
  const link = element("a");
  link.href = URL.createObjectURL(new Blob([corrections()], { type: "text/yaml" }));
  link.download = "corrections.yaml";
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  get("hint").textContent = "corrections.yaml was saved; pass it to vdet count --corrections.";
}

// ---------------------------------------------------------------- keys, and the start
function nextMark(step) {
  const marks = inMinute(), at = marks.findIndex(mark => mark.key === selected);
  if (!marks.length) return;
  selected = marks[at < 0 ? (step > 0 ? 0 : marks.length - 1) : (at + step + marks.length) % marks.length].key;
  refresh();
  document.querySelector(".mark.selected")?.scrollIntoView({ block: "nearest" });
}

const actions = { Enter: () => go(1, true), ArrowRight: () => go(1, false), ArrowLeft: () => go(-1, false), x: toggleFalse,
  d: turn, z: undo, s: save, Escape: () => { selected = null; refresh(); } };

document.addEventListener("keydown", event => {
  const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (event.target.matches("input")) return;
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
get("size").oninput = () => refresh(true);
get("reviewer").onchange = event => change(() => { state.reviewer = event.target.value.trim(); });

try {
  const stored = JSON.parse(localStorage.getItem(data.key));
  if (stored) ({ state, minute } = stored);
} catch {
  get("hint").textContent = "This browser keeps nothing; save before you close the page.";
}
get("reviewer").value = state.reviewer;
refresh(true);
document.body.dataset.ready = "yes";
