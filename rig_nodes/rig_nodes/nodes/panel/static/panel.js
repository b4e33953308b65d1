// The operator's page: what the rig tells goes to its place, and every control gives an order and shows its answer where the hand is.

import { Charts } from "./charts.js";
import { Driveline } from "./driveline.js";
import { Gauges } from "./gauges.js";
import { Link, at, fetched, make, measure, shown } from "./link.js";
import { READ, order, orderAbove, say } from "./orders.js";
import { Profiles } from "./profiles.js";
import { Sequences } from "./sequences.js";
import { Shifts } from "./shifts.js";

const MOST_EVENTS = 300;
const OLD = 1500; // ms without a new sample after which the clock says so
const NEED_RIG = ["drive", "profiles", "controller", "settings", "faults"]; // what does nothing while no rig answers
const link = new Link();
const charts = new Charts(link);
const driveline = new Driveline(charts);
const gauges = new Gauges(charts, (names) => charts.wish([...driveline.signals, ...names]));
const profiles = new Profiles(link);
const sequences = new Sequences(link);
const shifts = new Shifts(link);
const fields = new Map(); // by setting: functions that show its value, one for each place
const faults = new Map(); // by name: its switch
let there = { on: [], waiting: [] }; // names of the faults that are there
let rig = null;
let state = "";

history.replaceState(null, "", location.pathname + location.hash); // the token stays in the cookie only

// ---- light and dark

function paint(theme) {
  document.documentElement.dataset.theme = theme;
  charts.recolour();
  shifts.recolour();
}
at("theme").onclick = () => {
  const theme = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
  localStorage.setItem("rig-theme", theme);
  paint(theme);
};
const dark = matchMedia("(prefers-color-scheme: dark)");
dark.addEventListener("change", () => localStorage.getItem("rig-theme") || paint(dark.matches ? "dark" : "light"));
document.documentElement.dataset.theme = localStorage.getItem("rig-theme") ?? (dark.matches ? "dark" : "light");

// ---- orders

export function note(text) {
  const one = make("p", {}, text);
  at("notes").append(one);
  setTimeout(() => one.remove(), READ);
}

for (const what of ["e_stop", "reset", "start"]) at(what).onclick = () => orderAbove(link, what, at(what));
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape" && !event.repeat) orderAbove(link, "e_stop", at("e_stop"));
});

// ---- the rig

link.on("rig", (message) => {
  rig = message;
  document.title = `${message.name} – rig`;
  at("rig").textContent = message.name;
  at("about").textContent = `${message.text}; ROS domain ${message.domain}`;
  fields.clear();
  gears(message);
  settings(message.settings);
  showFaults(message.faults);
  driveline.rig(message);
  gauges.rig(message);
  charts.also = [...driveline.signals, ...gauges.names];
  charts.rig(message);
  gauges.build(); // by the signals that the charts have learned
  at("controller").hidden = !message.controller;
  ownSignals(message.own_signals);
  ownSettings(message.own_settings);
  profiles.rig(message);
  sequences.rig(message);
  shifts.rig(message);
  const delays = message.settings.filter(({ name }) => message.delays.includes(name));
  at("delays").replaceChildren(...delays.map((one) => setting(one, false, "beside the curves ")));
  for (const link of document.querySelectorAll("nav a")) link.hidden = at(link.hash.slice(1)).hidden;
});

function gears({ gears: all }) {
  at("gears").replaceChildren(
    ...all.map(({ number, name }) => {
      const button = make("button", { "data-gear": number, "aria-pressed": "false", title: `order gear ${name}` }, number ? name : "N");
      button.onclick = () => order(link, at("shifting"), "gear", { gear: number }, { control: button, begun: `gear ${name} is ordered` });
      return button;
    }),
  );
  const [oil, drive, load] = ["oil", "source", "load"].map((role) => rig.drive.filter((one) => one.role === role).map((one) => one.node.replaceAll("_", " ")).join(" and "));
  const pressure = oil && `give the ${oil} its pressure (say ${rig.steps[0].value}) and switch it on, `;
  at("hint").textContent = all.length
    ? `For a first shift: ${pressure}order the first gear, give the ${drive} a speed and switch it on, then the ${load}, then order the next gear. Its figure appears under Shifts.`
    : "This rig has no gears to order.";
}

// ---- settings

const owner = (one) => one.name.split(".")[0];

function settings(all) {
  const drive = all.filter((one) => one.setpoint);
  const place = (one) => rig.drive.findIndex(({ node }) => node === owner(one));
  at("setpoints").replaceChildren(...drive.sort((a, b) => place(a) - place(b) || (a.kind === "switch") - (b.kind === "switch")).map((one) => setting(one, true)));
  at("setting-list").replaceChildren();
  const groups = new Map();
  for (const one of all.filter((one) => !one.setpoint)) groups.set(owner(one), [...(groups.get(owner(one)) ?? []), one]);
  for (const [name, ones] of groups) at("setting-list").append(make("details", { open: groups.size < 3 }, make("summary", {}, name.replaceAll("_", " ")), ...ones.map((one) => setting(one, false))));
}

at("find").oninput = () => {
  const wanted = at("find").value.trim().toLowerCase();
  for (const group of at("setting-list").children) {
    let any = false;
    for (const row of group.querySelectorAll(".set")) {
      row.hidden = !row.dataset.words.includes(wanted);
      any ||= !row.hidden;
    }
    group.hidden = !any;
    if (wanted) group.open = any;
  }
};

// The controls of a setting; where it has some in a second place, ``place`` begins their ids.
function setting(one, slider, place = "") {
  const id = `${place}set ${one.name}`;
  const shows = (show) => fields.set(one.name, [...(fields.get(one.name) ?? []), show]);
  const said = make("p", { class: "said", role: "alert", id: `${place}said ${one.name}` });
  const row = make("div", { class: "set", "data-words": `${one.name} ${one.text}`.toLowerCase(), "data-setting": one.name });
  const words = make("label", { for: id, title: one.text }, slider ? one.name.replace(".", " ").replaceAll("_", " ") : one.text);
  if (one.kind === "switch") {
    const button = make("button", { id, "aria-pressed": "false", "aria-describedby": said.id }, "off");
    button.onclick = () => order(link, said, "set", { name: one.name, value: button.getAttribute("aria-pressed") === "true" ? "off" : "on" }, { control: button, quiet: true });
    shows((value) => {
      button.setAttribute("aria-pressed", String(value));
      button.textContent = value ? "on" : "off";
    });
    row.append(words, make("div", { class: "field" }, button), said);
    return row;
  }
  const unit = one.unit === "-" ? "" : one.unit;
  const field = make("input", { id, type: "text", inputmode: "decimal", autocomplete: "off", "aria-describedby": said.id });
  const ranged = one.low != null && one.high != null;
  const pull = slider && ranged ? make("input", { type: "range", min: one.low, max: one.high, step: (one.high - one.low) / 200, "aria-label": one.text }) : null;
  let held = null;
  let edited = false; // what is being typed or pulled is not written over
  const give = (text) => order(link, said, "set", { name: one.name, value: measure(text, unit) }, { control: field, quiet: true }).then((good) => {
    if (good) edited = false;
    if (good || document.activeElement !== field) back();
  });
  const show = (value) => {
    held = value;
    if (edited) return;
    field.value = shown(value, 5).replace(/(\.\d*?)0+$/, "$1").replace(/\.$/, "");
    if (pull) pull.value = value;
  };
  const back = () => {
    edited = false;
    if (held != null) show(held);
  };
  field.oninput = () => (edited = true);
  field.onchange = () => give(field.value);
  field.onblur = () => {
    back();
    setTimeout(() => said.dataset.kind === "refused" && say(said, ""), READ);
  };
  if (pull) {
    pull.oninput = () => (edited = true);
    pull.onchange = () => give(String(+(+pull.value).toPrecision(4))).then(back);
  }
  shows(show);
  const range = ranged ? `${shown(one.low, 4)} to ${shown(one.high, 4)} ${unit}` : "";
  row.append(make("div", {}, words, make("div", { class: "range" }, range)), make("div", { class: "field" }, field, make("span", { class: "unit" }, unit)), pull ?? "", said);
  return row;
}

link.on("values", ({ values }) => {
  for (const [name, value] of Object.entries(values)) for (const show of fields.get(name) ?? []) show(value);
  profiles.values(values);
});

// ---- state, events, devices

function usable(there) {
  for (const id of NEED_RIG) at(id).inert = !there;
  at("sequences").inert = !rig;
}
usable(false);

link.on("state", (message) => {
  at("state").textContent = message.e_stop ? "emergency stop" : rig ? message.state : "no rig yet";
  at("state").className = `pill ${message.state}`;
  at("reason").textContent = message.reason ?? "";
  at("reason").hidden = !message.reason;
  at("reset").disabled = message.state !== "tripped";
  at("start").hidden = !message.start;
  usable(message.state !== "away");
  if (message.state === "tripped" && state !== "tripped") say(at("shifting"), ""); // what was said of orders before
  state = message.state;
  for (const button of at("gears").children) button.setAttribute("aria-pressed", String(+button.dataset.gear === message.gear));
  at("gears").setAttribute("aria-busy", String(Boolean(message.shifting)));
});

link.on("event", (message) => {
  const bad = /trip|refused|fail|abort|stop|lost/.test(message.name);
  at("event-list").prepend(make("li", {}, make("time", {}, `${message.t.toFixed(3)} s`), make("span", { class: bad ? "bad" : "" }, ` ${message.text || message.name}`)));
  while (at("event-list").children.length > MOST_EVENTS) at("event-list").lastChild.remove();
});
link.on("restart", () => at("event-list").replaceChildren());

link.on("health", ({ devices, own, others, pages, participants }) => {
  plugged(devices[rig?.controller], own);
  recording(devices.recorder);
  at("device-list").replaceChildren(
    ...Object.entries(devices).map(([name, { level, text }]) => make("tr", {}, make("th", { scope: "row" }, name), make("td", { class: level === "ok" ? "" : "bad" }, text))),
  );
  at("others").textContent = `Open pages: ${pages}. ${others.length ? `Other nodes in the domain: ${others.join(", ")}` : "No other nodes are in the domain"}; ROS participants: ${participants}.`;
});

function recording(recorder) {
  const paused = recorder?.values.paused === "True";
  for (const id of ["rec-pause", "rec-split"]) at(id).disabled = !recorder || recorder.level === "stale";
  at("rec-pause").textContent = paused ? "Go on with the recording" : "Pause the recording";
  at("rec-pause").dataset.paused = paused ? "yes" : "";
}
at("rec-pause").onclick = () => order(link, at("rec-said"), "record", { what: at("rec-pause").dataset.paused ? "resume" : "pause" }, { control: at("rec-pause") });
at("rec-split").onclick = () => order(link, at("rec-said"), "record", { what: "split_bagfile" }, { control: at("rec-split") });
for (const [id, ending] of [["rec-bag", "bag.zip"], ["rec-report", "report.html"]]) {
  at(id).onclick = async () => {
    const began = Date.now(); // a long recording takes a minute beside the running rig, and shows no size before its end
    const wait = () => say(at("rec-said"), `${ending} is being made, ${Math.round((Date.now() - began) / 1000)} s …`, "asked");
    const ticking = setInterval(wait, 1000);
    wait();
    for (const other of ["rec-bag", "rec-report"]) at(other).disabled = true;
    const { text, blob } = await fetched(`${ending}?name=${encodeURIComponent(at("rec-name").value)}`);
    clearInterval(ticking);
    for (const other of ["rec-bag", "rec-report"]) at(other).disabled = false;
    if (!blob) return say(at("rec-said"), text, "refused");
    const address = URL.createObjectURL(blob);
    make("a", { href: address, download: `${at("rec-name").value || "recording"}.${ending.split(".")[1]}` }).click();
    setTimeout(() => URL.revokeObjectURL(address), 60000);
    say(at("rec-said"), "");
  };
}

// ---- the controller

link.on("own signals", ({ signals }) => {
  charts.learn(signals);
  gauges.build();
  ownSignals(signals);
});

function ownSignals(all) {
  at("own-signals").hidden = !all.length;
  at("own-list").replaceChildren(
    ...all.map(({ name, unit }) => {
      const chart = make("button", { "aria-label": `chart of ${name}` }, "Chart");
      chart.onclick = () => charts.add([name]);
      return make("tr", { "data-own": name }, make("th", { scope: "row" }, name), make("td", { class: "number" }, "–"), make("td", {}, unit === "-" ? "" : unit), make("td", {}, chart));
    }),
  );
}

// Those of a user's controller have no text, so their names stand there.
function ownSettings(all) {
  for (const { name } of all) fields.delete(name);
  at("own-settings").replaceChildren(...all.map((one) => setting({ ...one, text: one.name.replace(`${rig.controller}.`, "") }, false)));
}
link.on("own settings", ({ settings: all }) => ownSettings(all));

function plugged(controller, own) {
  at("controller-state").textContent = controller ? `${controller.values.controller}: ${controller.text}` : "no controller has answered yet";
  at("controller-state").className = controller?.level === "ok" ? "" : "bad";
  const values = Object.entries(controller?.values ?? {}).filter(([key]) => key !== "controller");
  at("controller-list").replaceChildren(...values.map(([key, value]) => make("tr", {}, make("th", { scope: "row" }, key.replaceAll("_", " ")), make("td", {}, value))));
  for (const row of at("own-list").children) row.children[1].textContent = shown(own[row.dataset.own], 5);
}

// ---- faults

function showFaults(all) {
  at("no-faults").textContent = all.length ? "" : "Faults are off for this run. Start the page with: ./rig panel RIG --faults";
  faults.clear();
  at("fault-list").replaceChildren(
    ...all
      .filter((one) => !one.lacking)
      .map((one) => {
        const said = make("p", { class: "said", role: "alert" });
        const size = one.size ? make("input", { type: "text", inputmode: "decimal", value: shown(one.usual), "aria-label": `${one.name}: ${one.size}` }) : null;
        const button = make("button", { "aria-pressed": "false", "aria-label": one.name }, "off");
        button.onclick = () => {
          const on = button.getAttribute("aria-pressed") === "true";
          const wanted = size && !on ? `, size=${measure(size.value, one.unit)}` : "";
          order(link, said, "fault", { order: on ? `${one.name}, off=true` : `${one.name}${wanted}` }, { control: button, quiet: true });
        };
        faults.set(one.name, (how) => {
          button.setAttribute("aria-pressed", String(how !== "off"));
          button.textContent = how;
        });
        const range = one.size ? `${one.size}: ${shown(one.low)} to ${shown(one.high)} ${one.unit}` : "";
        return make("div", { class: "set" }, make("div", {}, make("strong", {}, one.name), ` ${one.text}`, make("div", { class: "range" }, range)), make("div", { class: "field" }, size ?? "", size ? make("span", { class: "unit" }, one.unit) : "", button), said);
      }),
  );
  showFaulty();
}

function showFaulty() {
  for (const [name, show] of faults) show(there.on.includes(name) ? "on" : there.waiting.includes(name) ? "waits" : "off");
}
link.on("faults", (message) => {
  there = message;
  showFaulty();
});

// ---- connection

link.on("note", ({ text }) => note(text));
link.on("open", () => at("event-list").replaceChildren());
link.on("closed", () => {
  usable(false);
  at("state").textContent = "no connection";
  at("state").className = "pill away";
  at("reason").textContent = "The page's server does not answer; it is tried again every second. After a new start of ./rig panel, open the new address.";
  at("reason").hidden = false;
});
let drawn = 0; // when the newest samples were drawn
link.on("drawn", () => {
  driveline.draw();
  gauges.draw();
  drawn = performance.now();
  if (charts.now != null) at("clock").textContent = `${charts.now.toFixed(1)} s`;
});
setInterval(() => {
  const silent = performance.now() - drawn;
  if (charts.now != null && silent > OLD) at("clock").textContent = `${charts.now.toFixed(1)} s; nothing new for ${Math.floor(silent / 1000)} s`;
}, 500);
