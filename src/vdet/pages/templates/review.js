"use strict";
// The page of `vdet review`. A mark is a counted crossing, or a vehicle that was missed. What a person changes is the state:
// edits of marks by their number, added marks, and the checked minutes. Seconds count from the first frame of the video.
const MINUTE = 60;
const data = JSON.parse(document.getElementById("data").textContent);
const get = id => document.getElementById(id);
const key = `vdet review ${data.video} ${data.made}`;
const minutes = [...new Set(data.pictures.map(picture => picture.minute))].sort((a, b) => a - b);
const minuteOf = mark => Math.floor(mark.seconds / MINUTE);
let state = { edits: {}, added: [], checked: [], reviewer: "", sample: null };
let undone = []; // earlier states, as JSON
let minute = minutes[0] ?? 0, selected = null, lastClass = mostFrequent(data.marks.map(mark => mark.class)) ?? data.classes[0];

function mostFrequent(values) {
  const counts = new Map();
  for (const value of values) counts.set(value, (counts.get(value) ?? 0) + 1);
  return [...counts].sort((a, b) => b[1] - a[1])[0]?.[0];
}

// ---------------------------------------------------------------- marks and what a person says of them
/** Return all marks with what a person says: `error` is null, false, missed, class or direction. */
function allMarks() {
  const counted = data.marks.map((mark, number) => ({ ...mark, key: `c${number}`, error: null, ...state.edits[`c${number}`] }));
  return [...counted, ...state.added.map((mark, number) => ({ ...mark, key: `a${number}`, error: "missed" }))];
}

const directionsOf = mark => data.bands[mark.band].directions;
const otherDirection = (mark, direction) => directionsOf(mark).find(name => name !== direction);
const find = name => allMarks().find(mark => mark.key === name);

/** Change the state by a function, so that it can be undone and survives a reload. */
function change(edit) {
  undone.push(JSON.stringify(state));
  if (undone.length > 500) undone.shift();
  edit();
  refresh();
}

function editMark(name, values) {
  const [kind, number] = [name[0], Number(name.slice(1))];
  change(() => {
    if (kind === "a") Object.assign(state.added[number], values);
    else if (values === null) delete state.edits[name];
    else state.edits[name] = { ...state.edits[name], ...values };
  });
}

function toggleFalse() {
  const mark = find(selected);
  if (!mark) return;
  if (mark.error === "missed") {
    const number = Number(selected.slice(1));
    selected = null;
    change(() => state.added.splice(number, 1));
  } else editMark(selected, mark.error === "false" ? null : { error: "false", correct: undefined });
}

function setClass(name) {
  const mark = find(selected);
  if (!mark) return;
  lastClass = name;
  if (mark.error === "missed") editMark(selected, { class: name });
  else editMark(selected, name === mark.class ? null : { error: "class", correct: name });
}

function turn() {
  const mark = find(selected);
  if (!mark) return;
  if (mark.error === "missed") editMark(selected, { direction: otherDirection(mark, mark.direction) });
  else if (mark.error === "direction") editMark(selected, null);
  else editMark(selected, { error: "direction", correct: otherDirection(mark, mark.direction) });
}

/** Add a vehicle that was missed; its direction is that of the nearest marks at the line. */
function addMissed(band, seconds, place) {
  const near = data.marks.filter(mark => mark.band === band)
    .sort((a, b) => Math.abs(a.place - place) - Math.abs(b.place - place)).slice(0, 5);
  const direction = mostFrequent(near.map(mark => mark.direction)) ?? data.bands[band].directions[0];
  selected = `a${state.added.length}`;
  const rounded = Math.round(1000 * seconds) / 1000;
  change(() => state.added.push({ band, seconds: rounded, place, line: data.bands[band].name,
    time: Math.round(1000 * (seconds + data.start)) / 1000, direction, class: lastClass }));
}

function undo() {
  if (!undone.length) return;
  state = JSON.parse(undone.pop());
  if (selected && !find(selected)) selected = null;
  refresh();
}

/** Return the minutes to check: all, or those of the sample in the order in which they were drawn. */
const planned = () => state.sample?.minutes ?? minutes;

function draw() {
  const count = Math.min(minutes.length, Number(get("count").value));
  change(() => { state.sample = count >= 1 ? { seed: data.seed, minutes: data.order.slice(0, count) } : null; });
  if (!planned().includes(minute)) [minute, selected] = [planned()[0], null];
  refresh();
}

function go(steps, isChecked) {
  const next = planned()[planned().indexOf(minute) + steps];
  if (isChecked && !state.checked.includes(minute)) change(() => state.checked.push(minute));
  if (next === undefined) return refresh();
  [minute, selected] = [next, null];
  scrollTo(0, 0);
  refresh();
}

// ---------------------------------------------------------------- the view
const clock = seconds => `${Math.floor(seconds / 60)}:${(seconds % 60).toFixed(0).padStart(2, "0")}`;

function element(tag, className, text) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

function lengthOf(picture) {
  return Number(get("size").value) / data.bands[picture.band].samples; // screen pixels of a pixel of the strip
}

/** Show the strips of the minute; only its pictures are decoded. */
function drawStrips() {
  const strips = data.pictures.filter(picture => picture.minute === minute).map(picture => {
    const band = data.bands[picture.band], strip = element("div", "strip"), columns = element("div", "columns");
    const scale = lengthOf(picture), source = get(`strip-${picture.band}-${picture.minute}`).textContent;
    const address = `url("data:image/webp;base64,${source}")`;
    columns.dataset.band = picture.band;
    for (let number = 0; number < picture.columns; number++) {
      const column = element("div", picture.is_upward ? "column up" : "column"), view = element("i");
      const width = band.samples * scale;
      Object.assign(column.style, { width: `${width}px`, height: `${picture.height * scale}px` });
      Object.assign(view.style, { backgroundImage: address, backgroundPosition: `${-number * width}px 0`,
        backgroundSize: `${picture.columns * width}px ${picture.height * scale}px` });
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
  const name = mark.error === "class" ? mark.correct : mark.class;
  const direction = mark.error === "direction" ? mark.correct : mark.direction;
  const arrow = direction === directionsOf(mark)[0] ? "◁" : "▷";
  return `${arrow} ${name}${mark.id === undefined ? " +" : ` ${mark.id}`}`;
}

function drawMarks() {
  for (const old of document.querySelectorAll(".mark")) old.remove();
  for (const mark of inMinute()) {
    const picture = data.pictures.find(item => item.band === mark.band && item.minute === minute);
    const columns = document.querySelector(`.columns[data-band="${mark.band}"]`);
    if (!picture || !columns) continue;
    const along = (mark.seconds - MINUTE * minute) / picture.seconds;
    const column = Math.min(Math.floor(along), picture.columns - 1), down = along - column;
    const button = element("button", `mark ${mark.error ?? ""} ${mark.key === selected ? "selected" : ""}`, labelOf(mark));
    button.dataset.key = mark.key;
    button.title = `${mark.seconds.toFixed(2)} s, ${mark.direction}`;
    Object.assign(button.style, { left: `${100 * mark.place}%`, top: `${100 * (picture.is_upward ? 1 - down : down)}%` });
    button.onclick = () => { selected = mark.key; refresh(); };
    columns.children[column].append(button);
  }
}

function drawDetails() {
  const mark = find(selected), box = get("details");
  if (!mark) return box.replaceChildren(element("p", "", "Select a mark, or click on a vehicle without one."));
  const words = { missed: "missed", false: "false: no vehicle", class: "wrong class", direction: "wrong direction" };
  const title = `${mark.line}, ${clock(mark.seconds)}${mark.id === undefined ? "" : `, id ${mark.id}`}: ${words[mark.error] ?? "right"}`;
  const button = (text, action, isOn) => {
    const made = element("button", "", text);
    made.setAttribute("aria-pressed", isOn);
    made.onclick = action;
    return made;
  };
  const name = mark.error === "class" ? mark.correct : mark.class;
  const direction = mark.error === "direction" ? mark.correct : mark.direction;
  box.replaceChildren(element("h3", "", title),
    button(mark.error === "missed" ? "X Remove" : "X False", toggleFalse, mark.error === "false"),
    button(`D ${direction}`, turn, mark.error === "direction"),
    ...data.classes.map((item, i) => button(`${i < 9 ? i + 1 : ""} ${item}`, () => setClass(item), item === name)));
}

/** Return the rows of the table: line, class, counted, and in checked minutes: counted, missed, false, wrongly named. */
function totals() {
  const rows = new Map(), columns = ["counted", "checked", "missed", "false", "class", "direction"];
  for (const mark of allMarks()) {
    for (const name of [[mark.line, "all"], [mark.line, mark.class]]) {
      const row = rows.get(name.join("\t")) ?? rows.set(name.join("\t"), Object.fromEntries(columns.map(item => [item, 0])))
        .get(name.join("\t"));
      if (mark.error !== "missed") row.counted++;
      if (mark.error !== "missed" && state.checked.includes(minuteOf(mark))) row.checked++;
      if (mark.error) row[mark.error]++;
    }
  }
  return [...rows].map(([name, row]) => [...name.split("\t"), ...columns.map(item => row[item])]).sort((a, b) => a[0] < b[0] ? -1 : a[0] > b[0] ? 1 : b[2] - a[2]);
}

function drawSummary() {
  const table = element("table", "named"), head = element("tr");
  for (const text of ["line", "class", "counted", "checked", "missed", "false", "class", "dir."]) head.append(element("th", "", text));
  table.append(head);
  for (const values of totals()) {
    const row = element("tr");
    for (const value of values) row.append(element("td", "", value));
    table.append(row);
  }
  const done = planned().filter(item => state.checked.includes(item)).length;
  get("summary").replaceChildren(element("p", "", `${done} of ${planned().length} minutes checked`), table);
}

/** Show the estimate of the true count by the checked minutes of the sample. */
function drawEstimate() {
  const errors = allMarks().filter(mark => mark.error && mark.error !== "direction" && state.checked.includes(minuteOf(mark)))
    .map(mark => ({ minute: minutes.indexOf(minuteOf(mark)), counted: mark.error === "missed" ? null : mark.class,
      true: mark.error === "false" ? null : mark.correct ?? mark.class }));
  const indices = list => new Set(list.map(item => minutes.indexOf(item)));
  const rows = estimateCounts({ counted: data.counted, strata: data.strata, errors, checked: indices(state.checked),
    drawn: indices(state.sample?.minutes ?? []) });
  const text = row => `${row.group ?? "all"}: ${row.counted} counted, ${Math.round(row.true)} true ` +
    `(${Math.round(row.low)} to ${Math.round(row.high)})` + (row.more ? `; ${row.more} more minutes for ± 2 %` : "");
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
    localStorage.setItem(key, JSON.stringify({ state, minute }));
  } catch {
    get("hint").textContent = "This browser keeps nothing; save before you close the page.";
  }
}

// ---------------------------------------------------------------- the file
const quoted = text => JSON.stringify(String(text));
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

function eventText(mark) {
  const parts = [`line: ${quoted(mark.line)}`, `time: ${mark.time}`, `direction: ${quoted(mark.direction)}`, `class: ${quoted(mark.class)}`];
  if (mark.id !== undefined) parts.push(`id: ${mark.id}`);
  if (mark.error) parts.push(`error: ${quoted(mark.error)}`);
  if (mark.correct) parts.push(`correct: ${quoted(mark.correct)}`);
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
  const checked = names.flatMap(name => spans().map(([start, end]) => `  - {line: ${quoted(name)}, start: ${start + data.start}, end: ${end + data.start}}`));
  const complete = spans().concat(state.added.map(mark => [mark.seconds, mark.seconds]));
  const isListed = mark => mark.error || complete.some(([start, end]) => mark.seconds > start - 1 && mark.seconds < end + 1);
  const events = allMarks().filter(isListed).sort((a, b) => a.time - b.time).map(eventText);
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
  const kept = JSON.parse(localStorage.getItem(key));
  if (kept) ({ state, minute } = kept);
} catch {
  get("hint").textContent = "This browser keeps nothing; save before you close the page.";
}
get("reviewer").value = state.reviewer;
refresh(true);
document.body.dataset.ready = "yes";
