// The table of the vehicles of a page: filtered, sorted, and shown some rows at a time.
"use strict";

const PER_PAGE = 100;
const PRINTED = 2000;

const data = JSON.parse(document.getElementById("vehicles").textContent);
data.video = new Int32Array(data.class.length);
let begin = 0;
data.counts.forEach((count, video) => {
  data.video.fill(video, begin, begin + count);
  begin += count;
});
const known = new Set(Object.keys(data));
if (data.names.length < 2) known.delete("video");
for (const name of ["lines", "motion", "side", "size", "certainty", "speed", "distance", "lane", "clock", "picture", "clip"]) {
  data[name] ??= new Array(data.class.length).fill(null);
}

// Columns: heading, text of a cell, its link, and what rows are sorted by (numbers sort with nulls last).
const columns = [
  { name: "id", text: i => `#${data.id[i]}`, key: i => data.id[i] },
  { name: "class", text: i => data.class[i], key: i => data.class[i] },
  { name: "video", text: i => data.names[data.video[i]], key: i => data.video[i], used: "video" },
  { name: "time", text: timeText, key: i => data.clock[i] ?? data.first[i], link: moment },
  { name: "clip", text: i => data.clip[i] && "clip", key: i => data.clip[i], link: i => data.clip[i], used: "clip" },
  { name: "seconds", text: i => data.seconds[i].toFixed(1), key: i => data.seconds[i] },
  { name: "km/h", text: i => number(data.speed[i]), key: i => data.speed[i], used: "speed" },
  { name: "lines", text: i => data.lines[i], key: i => data.lines[i], used: "lines" },
  { name: "lane", text: i => data.lane[i] ?? "", key: i => data.lane[i], used: "lane" },
  { name: "metres", text: i => number(data.distance[i]), key: i => data.distance[i], used: "distance" },
  { name: "motion", text: i => data.motion[i], key: i => data.motion[i], used: "motion" },
  { name: "side", text: i => data.side[i], key: i => data.side[i], used: "side" },
  { name: "size", text: i => data.size[i], key: i => data.size[i], used: "size" },
].filter(column => !column.used || known.has(column.used));

const form = document.getElementById("filters");
const filter = document.getElementById("filter");
const body = document.querySelector("#found tbody");
let rows = [];
let unknown = 0; // rows that pass no filter of a value that they lack, and pass all others
let limit = PER_PAGE;
let page = 0;
let sort = { column: null, descending: false };

function number(value) {
  return value?.toFixed(0) ?? "";
}

function pad(value) {
  return String(value).padStart(2, "0");
}

function thousands(value) {
  return String(value).replace(/\B(?=(\d{3})+$)/g, ",");
}

function timeText(i) {
  if (data.clock[i] !== null) {
    // The clock is in seconds as the camera shows them: it is printed without a shift.
    const moment = new Date(1000 * data.clock[i]);
    return moment.toISOString().slice(0, 19).replace("T", " ");
  }
  const seconds = Math.floor(data.first[i]);
  return `${Math.floor(seconds / 3600)}:${pad(Math.floor(seconds / 60) % 60)}:${pad(seconds % 60)}`;
}

// Return the address of the first moment of a vehicle in the page of its video; without a player, of its clip or the page.
function moment(i) {
  const [page, start] = [data.pages[data.video[i]], data.starts[data.video[i]]];
  if (!data.plays[data.video[i]]) return data.clip[i] || page;
  return `${page}#t=${Math.max(0, data.first[i] - start).toFixed(3)}`;
}

// Return the row numbers that pass all filters. Filters that are empty are skipped.
function filtered() {
  const values = Object.fromEntries(new FormData(form));
  const tests = [];
  const choice = name => {
    if (values[name]) tests.push(i => String(data[name][i]) === values[name]);
  };
  const limits = (column, low, high) => {
    if (low) tests.push(i => column[i] === null ? null : column[i] >= Number(low));
    if (high) tests.push(i => column[i] === null ? null : column[i] <= Number(high));
  };
  const clockTime = value => value && String(Date.parse(`${value}Z`) / 1000);
  const inSeconds = value => value && String(value.split(":").reduce((sum, part) => 60 * sum + Number(part), 0));
  ["class", "lines", "motion", "side", "size", "certainty", "lane"].forEach(choice);
  for (const name of ["seconds", "speed", "distance"]) {
    limits(data[name], values[`${name}-min`], values[`${name}-max`]);
  }
  limits(data.first, inSeconds(values["first-min"]), inSeconds(values["first-max"]));
  limits(data.clock, clockTime(values.from), clockTime(values.until));
  if (values.video) {
    const part = values.video.toLowerCase();
    const named = data.names.map(name => name.toLowerCase().includes(part));
    tests.push(i => named[data.video[i]]);
  }
  const found = [];
  unknown = 0;
  for (let i = 0; i < data.class.length; i += 1) {
    if (tests.every(test => test(i))) found.push(i);
    else if (tests.every(test => test(i) !== false)) unknown += 1;
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
  const address = column.link?.(i);
  if (address) {
    const link = element.appendChild(document.createElement("a"));
    link.href = address;
    if (address.startsWith("#t=")) link.dataset.time = address.slice(3);
    link.textContent = column.text(i);
  } else {
    element.textContent = column.text(i);
  }
  if (!isNaN(element.textContent)) element.dataset.name = column.name; // where there are no headings above
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
  const last = Math.max(0, Math.ceil(rows.length / limit) - 1);
  page = Math.min(Math.max(0, page), last);
  const shown = rows.slice(page * limit, (page + 1) * limit);
  body.replaceChildren(...shown.map(i => {
    const row = document.createElement("tr");
    if (known.has("picture")) row.append(picture(i));
    row.append(...columns.map(column => cell(column, i)));
    return row;
  }));
  const [first, all] = [page * limit, data.class.length];
  document.getElementById("range").textContent = !rows.length ? "No vehicle matches the filters."
    : `${thousands(first + 1)}–${thousands(first + shown.length)} of ${thousands(rows.length)}`
      + (rows.length < all ? ` (${thousands(all)} without filters)` : "");
  if (unknown) document.getElementById("range").append(`; ${thousands(unknown)} without such a value`);
  document.getElementById("previous").disabled = page === 0;
  document.getElementById("next").disabled = page === last;
}

function update() {
  rows = sorted(filtered());
  page = 0;
  show();
  for (const label of form.querySelectorAll("label")) {
    const isSet = [...label.querySelectorAll("input, select")].some(input => input.value);
    label.classList.toggle("unprinted", !isSet);
  }
  const used = form.querySelectorAll("label:not(.unprinted)").length;
  filter.firstElementChild.textContent = used ? `Filter (${used})` : "Filter";
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

function fill(name) {
  const select = form.elements[name];
  const used = [...new Set(data[name])].filter(value => value);
  select.append(...used.map(value => new Option(value)));
  select.closest("label").hidden = used.length < 2;
}

const head = document.querySelector("#found thead tr");
if (known.has("picture")) head.append(document.createElement("th"));
head.append(...columns.map(heading));
["class", "lines", "motion", "side", "size", "certainty"].forEach(fill);
const lanes = [...new Set(data.lane)].filter(lane => lane !== null).sort((a, b) => a - b);
form.elements.lane.append(...lanes.map(lane => new Option(lane)));
for (const element of form.querySelectorAll("[data-needs]")) {
  element.hidden = !known.has(element.dataset.needs);
}
form.addEventListener("input", update);
form.addEventListener("reset", () => setTimeout(update));
document.getElementById("previous").addEventListener("click", () => { page -= 1; show(); });
document.getElementById("next").addEventListener("click", () => { page += 1; show(); });

// On paper, the table goes on over the pages of the screen.
let left = {};
addEventListener("beforeprint", () => {
  left = { page, open: filter.open };
  [page, limit, filter.open] = [0, PRINTED, true];
  show();
});
addEventListener("afterprint", () => { [page, limit, filter.open] = [left.page, PER_PAGE, left.open]; show(); });

filter.open = matchMedia("(min-width: 601px)").matches;
update();
// On the way back to this page, the browser fills in the filters after its scripts have run.
addEventListener("pageshow", event => { if (!event.persisted) update(); });
