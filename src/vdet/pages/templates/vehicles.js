// The table of the vehicles of a page: filtered, sorted, and shown some rows at a time.
"use strict";

const data = JSON.parse(document.getElementById("vehicles").textContent);
const PER_PAGE = 100;

// Columns: heading, text of a cell, and what rows are sorted by (numbers sort with nulls last).
const columns = [
  { name: "id", text: i => `#${data.id[i]}`, key: i => data.id[i] },
  { name: "class", text: i => data.classes[data.class[i]], key: i => data.classes[data.class[i]] },
  { name: "video", text: i => data.videos[data.video[i]].name, key: i => data.video[i], used: "video" },
  { name: "time", text: timeText, key: i => data.clock[i] ?? data.first[i], link: true },
  { name: "seconds", text: i => data.seconds[i].toFixed(1), key: i => data.seconds[i] },
  { name: "km/h", text: i => number(data.speed[i]), key: i => data.speed[i], used: "speed" },
  { name: "lines", text: i => data.ways[data.way[i]], key: i => data.ways[data.way[i]], used: "way" },
  { name: "lane", text: i => data.lane[i] ?? "–", key: i => data.lane[i], used: "lane" },
  { name: "metres", text: i => number(data.distance[i]), key: i => data.distance[i], used: "distance" },
  { name: "moves", text: i => data.states[data.state[i]], key: i => data.state[i], used: "state" },
].filter(column => !column.used || isUsed(column.used));

// Return whether a column says something: numbers of texts and of videos are 0 for nothing else.
function isUsed(name) {
  const coded = ["video", "class", "way", "state"].includes(name);
  return data[name].some(value => coded ? value > 0 : value !== null);
}

const form = document.getElementById("filters");
const body = document.querySelector("#found tbody");
let rows = [];
let page = 0;
let sort = { column: null, descending: false };

function number(value) {
  return value === null ? "–" : value.toFixed(0);
}

function pad(value) {
  return String(value).padStart(2, "0");
}

function timeText(i) {
  if (data.clock[i] !== null) {
    // The clock is in seconds as the camera shows them: it is printed without a shift.
    return new Date(1000 * data.clock[i]).toISOString().slice(0, 19).replace("T", " ");
  }
  const seconds = Math.floor(data.first[i]);
  return `${Math.floor(seconds / 3600)}:${pad(Math.floor(seconds / 60) % 60)}:${pad(seconds % 60)}`;
}

// Return the row numbers that pass all filters. Filters that are empty are skipped.
function filtered() {
  const values = Object.fromEntries(new FormData(form));
  const tests = [];
  const choice = (name, column) => {
    if (values[name]) tests.push(i => column[i] === Number(values[name]));
  };
  const limits = (name, column) => {
    const [low, high] = [values[`${name}-min`], values[`${name}-max`]];
    if (low) tests.push(i => column[i] !== null && column[i] >= Number(low));
    if (high) tests.push(i => column[i] !== null && column[i] <= Number(high));
  };
  choice("class", data.class);
  choice("way", data.way);
  choice("state", data.state);
  limits("seconds", data.seconds);
  limits("speed", data.speed);
  limits("distance", data.distance);
  if (values.lane) tests.push(i => data.lane[i] === Number(values.lane));
  if (values.video) {
    const text = values.video.toLowerCase();
    const named = data.videos.map(video => video.name.toLowerCase().includes(text));
    tests.push(i => named[data.video[i]]);
  }
  const moment = text => Date.parse(`${text}Z`) / 1000;
  if (values.from) tests.push(i => data.clock[i] !== null && data.clock[i] >= moment(values.from));
  if (values.until) tests.push(i => data.clock[i] !== null && data.clock[i] <= moment(values.until));
  const found = [];
  for (let i = 0; i < data.class.length; i += 1) {
    if (tests.every(test => test(i))) found.push(i);
  }
  return found;
}

function sorted(found) {
  if (!sort.column) return found;
  const keys = new Array(data.class.length);
  for (const i of found) keys[i] = sort.column.key(i);
  const sign = sort.descending ? -1 : 1;
  return found.sort((a, b) => {
    const [x, y] = [keys[a], keys[b]];
    if (x === y) return a - b;
    if (x === null) return 1;
    if (y === null) return -1;
    return x < y ? -sign : sign;
  });
}

function cell(column, i) {
  const element = document.createElement("td");
  const { page } = data.videos[data.video[i]];
  if (column.link && page !== null) {
    const link = element.appendChild(document.createElement("a"));
    link.href = `${page}#t=${data.moment[i]}`;
    if (!page) link.dataset.time = data.moment[i];
    link.textContent = column.text(i);
  } else {
    element.textContent = column.text(i);
  }
  return element;
}

function picture(i) {
  const element = document.createElement("td");
  if (data.picture[i]) {
    const image = element.appendChild(document.createElement("img"));
    Object.assign(image, { loading: "lazy", decoding: "async", alt: "", src: data.picture[i] });
  }
  return element;
}

function show() {
  const last = Math.max(0, Math.ceil(rows.length / PER_PAGE) - 1);
  page = Math.min(Math.max(0, page), last);
  const shown = rows.slice(page * PER_PAGE, (page + 1) * PER_PAGE);
  const hasPictures = data.picture.some(Boolean);
  body.replaceChildren(...shown.map(i => {
    const row = document.createElement("tr");
    if (hasPictures) row.append(picture(i));
    row.append(...columns.map(column => cell(column, i)));
    return row;
  }));
  const first = rows.length ? page * PER_PAGE + 1 : 0;
  document.getElementById("range").textContent =
    `${first.toLocaleString("en")}–${(first && first + shown.length - 1).toLocaleString("en")}`
    + ` of ${rows.length.toLocaleString("en")} (${data.class.length.toLocaleString("en")} in all)`;
  document.getElementById("previous").disabled = page === 0;
  document.getElementById("next").disabled = page === last;
}

function update() {
  rows = sorted(filtered());
  page = 0;
  show();
}

function heading(column) {
  const element = document.createElement("th");
  const button = element.appendChild(document.createElement("button"));
  button.type = "button";
  button.textContent = column.name;
  button.addEventListener("click", () => {
    sort = { column, descending: sort.column === column && !sort.descending };
    for (const other of element.parentElement.children) other.removeAttribute("aria-sort");
    element.setAttribute("aria-sort", sort.descending ? "descending" : "ascending");
    update();
  });
  return element;
}

function fill(name, values) {
  const select = form.elements[name];
  const used = values.map((value, number) => [value, number]).filter(([value]) => value);
  select.append(...used.map(([value, number]) => new Option(value, number)));
  select.closest("label").hidden = used.length < 2;
}

const head = document.querySelector("#found thead tr");
if (data.picture.some(Boolean)) head.append(document.createElement("th"));
head.append(...columns.map(heading));
fill("class", data.classes);
fill("way", data.ways);
fill("state", data.states);
const lanes = [...new Set(data.lane)].filter(lane => lane !== null).sort((a, b) => a - b);
form.elements.lane.append(...lanes.map(lane => new Option(lane)));
for (const element of form.querySelectorAll("[data-needs]")) {
  element.hidden = !isUsed(element.dataset.needs);
}
form.addEventListener("input", update);
form.addEventListener("reset", () => setTimeout(update));
document.getElementById("previous").addEventListener("click", () => { page -= 1; show(); });
document.getElementById("next").addEventListener("click", () => { page += 1; show(); });
update();
