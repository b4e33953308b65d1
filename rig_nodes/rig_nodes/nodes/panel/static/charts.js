// Strip charts of signals by name, on uPlot: each stretch of time is drawn from its lowest to its highest value.

import { at, colour, make, shown } from "./link.js";

const STRETCHES = 400; // of a chart's width
const HEAD = 24; // bytes at the head of a frame
const HEIGHT = 150;
const KEY = "rig-charts";

export class Charts {
  constructor(link) {
    this.link = link;
    this.rows = []; // {names, plot, node}
    this.also = []; // signals that others show: the driveline
    this.known = new Map();
    this.columns = new Map(); // by signal: {lo, hi}
    this.x = [];
    this.number = 0;
    this.names = [];
    this.now = null;
    at("more").onclick = () => this.add([]);
    at("span").onchange = () => this.wish();
    at("pause").onclick = () => {
      this.held = this.held ? null : { x: [...this.x], length: this.length, columns: new Map([...this.columns].map(([name, { lo, hi }]) => [name, { lo: [...lo], hi: [...hi] }])) };
      at("pause").setAttribute("aria-pressed", String(Boolean(this.held)));
      this.stale();
    };
    link.on("frame", (data) => this.take(data));
    document.addEventListener("visibilitychange", () => document.hidden && this.thank()); // nothing is drawn until it is seen again
    new ResizeObserver(() => this.resize()).observe(at("strips"));
    requestAnimationFrame(() => this.draw());
  }

  rig(message) {
    this.known = new Map();
    for (const row of this.rows) row.plot?.destroy();
    this.rows = [];
    at("signals").replaceChildren();
    this.learn([...message.signals, ...message.own_signals]);
    let saved = null;
    try {
      saved = JSON.parse(localStorage.getItem(`${KEY} ${message.name}`));
    } catch {
      // what was kept is not ours
    }
    if (this.held) at("pause").click(); // of the rig before
    this.rig_name = message.name;
    at("strips").replaceChildren();
    // signals of a controller become known later, so what a user has chosen stays
    for (const names of Array.isArray(saved) && saved.length ? saved : message.chart) this.add([...names], false);
    this.wish();
  }

  // Takes signals that can be shown.
  learn(signals) {
    for (const one of signals) {
      if (!this.known.has(one.name)) at("signals").append(make("option", { value: one.name }, `${one.text} [${one.unit}]`));
      this.known.set(one.name, one);
    }
    for (const row of this.rows) if (row.names.some((name) => signals.some((one) => one.name === name))) this.build(row);
  }

  // Charts and picture together decide what the server sends.
  wish(also = this.also) {
    this.also = also;
    this.names = [...new Set([...this.rows.flatMap((row) => row.names), ...also])].slice(0, 64);
    this.clear();
    this.number += 1;
    this.length = Math.max(0.02, at("span").value / STRETCHES);
    if (this.names.length) this.link.ask("wish", { number: this.number, signals: this.names, length: this.length }).catch(() => {});
  }

  clear() {
    this.x = [];
    this.columns = new Map(this.names.map((name) => [name, { lo: [], hi: [] }]));
    this.fresh = true;
  }

  save() {
    localStorage.setItem(`${KEY} ${this.rig_name}`, JSON.stringify(this.rows.map((row) => row.names)));
  }

  add(names, wished = true) {
    const row = { names, node: make("div", { class: "strip" }) };
    this.rows.push(row);
    at("strips").append(row.node);
    this.build(row);
    if (wished) {
      this.save();
      if (names.length) this.wish();
      row.node.querySelector("input").focus();
    }
  }

  build(row) {
    row.plot?.destroy();
    const enter = make("input", { list: "signals", placeholder: "add a signal", "aria-label": "add a signal to this chart" });
    const said = make("span", { class: "bad", role: "alert" });
    enter.addEventListener("change", () => {
      const name = enter.value.trim();
      said.textContent = "";
      if (!this.known.has(name)) {
        said.textContent = name ? `there is no signal '${name}'` : "";
        return;
      }
      if (!row.names.includes(name)) row.names.push(name);
      this.changed(row);
    });
    row.values = new Map();
    const chips = row.names.map((name, k) => {
      const one = this.known.get(name) ?? { text: name, unit: "" };
      const value = make("span", { class: "value" }, "–");
      row.values.set(name, value);
      const sign = make("i");
      sign.style.background = `var(--c${k % 6})`;
      const gone = make("button", { "aria-label": `take ${name} out of the chart`, title: "take it out" }, "×");
      gone.onclick = () => {
        row.names = row.names.filter((other) => other !== name);
        this.changed(row);
      };
      return make("span", { class: "chip", title: one.text }, sign, name, value, make("span", { class: "dim" }, one.unit === "-" ? "" : one.unit), gone);
    });
    const drop = make("button", { "aria-label": "remove this chart", title: "remove this chart" }, "Remove");
    drop.onclick = () => {
      row.plot?.destroy();
      row.node.remove();
      this.rows = this.rows.filter((other) => other !== row);
      this.save();
      this.wish();
    };
    const ground = make("div");
    row.node.replaceChildren(make("div", { class: "chips" }, ...chips, enter, drop, said), ground);
    row.plot = row.names.length ? this.plot(row, ground) : null;
    row.stale = true;
  }

  // Has all charts drawn anew, also while they are held.
  stale() {
    for (const row of this.rows) row.stale = true;
    this.fresh = true;
  }

  changed(row) {
    this.build(row);
    this.save();
    this.wish();
  }

  plot(row, ground) {
    const ink = colour("dim");
    const grid = { stroke: colour("grid"), width: 1 };
    const series = [{}];
    const bands = [];
    row.names.forEach((name, k) => {
      const stroke = colour(`c${k % 6}`);
      series.push({ stroke, width: 1.5, points: { show: false }, spanGaps: true }, { stroke, width: 1.5, points: { show: false }, spanGaps: true });
      bands.push({ series: [series.length - 1, series.length - 2], fill: stroke });
    });
    return new uPlot(
      {
        width: Math.max(200, at("strips").clientWidth),
        height: HEIGHT,
        series,
        bands,
        legend: { show: false },
        cursor: { y: false, points: { show: false } },
        scales: { x: { time: false } },
        axes: [
          { stroke: ink, grid, ticks: grid, size: 28, values: (_, ticks) => ticks.map((t) => `${+t.toFixed(3)} s`) },
          { stroke: ink, grid, ticks: grid, size: 58 },
        ],
      },
      [[], ...series.slice(1).map(() => [])],
      ground,
    );
  }

  resize() {
    for (const row of this.rows) row.plot?.setSize({ width: Math.max(200, at("strips").clientWidth), height: HEIGHT });
  }

  recolour() {
    for (const row of this.rows) this.build(row);
    this.fresh = true;
  }

  take(data) {
    const head = new DataView(data);
    this.owed = true; // the next frame comes when this one is drawn
    if (document.hidden) this.thank();
    if (head.getUint32(0, true) !== this.number) return; // of an earlier wish
    const count = head.getUint32(4, true);
    const start = head.getFloat64(8, true);
    const length = head.getFloat64(16, true);
    if (this.x.length && start < this.x.at(-1) - length) this.clear();
    const all = new Float32Array(data, HEAD);
    const most = Math.ceil(at("span").value / length);
    this.now = start + count * length;
    for (let k = 0; k < count; k += 1) this.x.push(start + (k + 0.5) * length);
    const over = Math.max(0, this.x.length - most);
    this.x.splice(0, over);
    this.names.forEach((name, place) => {
      const column = this.columns.get(name);
      const from = 2 * place * count;
      for (let k = 0; k < count; k += 1) {
        const [lo, hi] = [all[from + k], all[from + count + k]];
        column.lo.push(Number.isNaN(lo) ? null : lo);
        column.hi.push(Number.isNaN(hi) ? null : hi);
      }
      column.lo.splice(0, over);
      column.hi.splice(0, over);
    });
    this.fresh = true;
  }

  thank() {
    if (this.owed && this.link.socket.readyState === WebSocket.OPEN) this.link.socket.send("+");
    this.owed = false;
  }

  latest(name) {
    const column = this.columns.get(name);
    if (!column) return null;
    for (let k = column.lo.length - 1; k >= 0 && k > column.lo.length - 60; k -= 1) if (column.lo[k] != null) return 0.5 * (column.lo[k] + column.hi[k]);
    return null;
  }

  // What a chart shows of a signal: while it is held, a copy that no longer grows; of a signal that comes meanwhile, what falls into it.
  column(name) {
    const live = this.columns.get(name) ?? { lo: [], hi: [] };
    if (!this.held) return live;
    const { x, length, columns } = this.held;
    if (!columns.has(name) && live.lo.length) {
      const first = Math.round(this.x[0] / length - 0.5);
      const places = x.map((t) => (length === this.length ? Math.round(t / length - 0.5) - first : -1)); // of another window: nothing
      columns.set(name, { lo: places.map((k) => live.lo[k] ?? null), hi: places.map((k) => live.hi[k] ?? null) });
    }
    return columns.get(name) ?? live;
  }

  // A value as people read it; a state by its word, and a dash where there is none.
  read(name, value, digits) {
    const states = this.known.get(name)?.states ?? {};
    if (value == null) return "–";
    return Object.keys(states).length ? (states[Math.round(value)] ?? "–") : shown(value, digits);
  }

  draw() {
    requestAnimationFrame(() => this.draw());
    this.thank();
    if (!this.fresh || document.hidden) return;
    this.fresh = false;
    const x = this.held?.x ?? this.x;
    const blank = x.map(() => null);
    for (const row of this.rows) {
      if (!row.plot || (this.held && !row.stale)) continue;
      const columns = row.names.map((name) => this.column(name));
      row.stale = columns.some((one) => one.lo.length !== x.length);
      if (row.stale && !this.held) continue;
      row.plot.setData([x, ...columns.flatMap(({ lo, hi }) => (lo.length === x.length ? [lo, hi] : [blank, blank]))]);
    }
    for (const row of this.rows) {
      for (const [name, node] of row.values) node.textContent = this.read(name, this.latest(name));
    }
    this.link.emit("drawn");
  }
}
