// The connection to the server: orders with their answers, messages by kind, frames of the charts; it connects again by itself.

const STUCK = 1000; // ms between two tries
const name = Math.random().toString(36).slice(2);

export class Link {
  constructor() {
    this.listeners = {};
    this.waiting = new Map();
    this.count = 0;
    this.connect();
  }

  on(kind, listener) {
    (this.listeners[kind] ??= []).push(listener);
  }

  emit(kind, message) {
    for (const listener of this.listeners[kind] ?? []) listener(message);
  }

  connect() {
    this.socket = new WebSocket(`${location.origin.replace(/^http/, "ws")}/live?page=${name}`);
    this.socket.binaryType = "arraybuffer";
    let opened = false;
    this.socket.onopen = () => {
      opened = true;
      this.emit("open");
    };
    this.socket.onmessage = ({ data }) => {
      if (typeof data !== "string") return this.emit("frame", data);
      const message = JSON.parse(data);
      if (message.kind === "answer") this.settle(message);
      else if (message.kind === "accepted") this.waiting.get(message.id)?.accepted();
      else this.emit(message.kind, message);
    };
    this.socket.onclose = () => {
      for (const { reject } of this.waiting.values()) reject(new Error("the connection to the page's server was lost; look at the rig before you try again"));
      this.waiting.clear();
      this.emit("closed");
      setTimeout(() => this.connect(), opened ? STUCK : 3 * STUCK);
    };
  }

  settle({ id, ok, text }) {
    const one = this.waiting.get(id);
    if (!one) {
      if (!ok) this.emit("note", { text });
      return;
    }
    this.waiting.delete(id);
    if (ok) one.resolve(text);
    else one.reject(new Error(text));
  }

  // Gives an order; the promise has the rig's answer, or its refusal as an error; ``accepted`` is called when what takes time has begun.
  ask(order, more = {}, accepted = () => {}) {
    return new Promise((resolve, reject) => {
      if (this.socket.readyState !== WebSocket.OPEN) return reject(new Error("there is no connection to the page's server"));
      const id = ++this.count;
      this.waiting.set(id, { resolve, reject, accepted });
      this.socket.send(JSON.stringify({ id, do: order, ...more }));
    });
  }
}

// Fetches from the page's server: what it has sent, or the text of its answer or refusal.
export async function fetched(address, options = {}) {
  try {
    const answer = await fetch(address, options);
    if (answer.ok && !options.method) return { ok: true, blob: await answer.blob() };
    return { ok: answer.ok, text: (await answer.text()).replace(/^rig: /, "") };
  } catch {
    return { ok: false, text: "the page's server does not answer" };
  }
}

// Makes an element; texts are always texts, never markup.
export function make(tag, attributes = {}, ...children) {
  const one = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) one.addEventListener(key.slice(2), value);
    else if (value === true) one.setAttribute(key, "");
    else if (value !== false && value != null) one.setAttribute(key, value);
  }
  one.append(...children.filter((child) => child != null));
  return one;
}

// A number as a hand writes it, perhaps with a decimal comma.
export const decimal = (text) => text.trim().replace(/,(?=\d)/g, ".");

// The same with the unit of its field, unless it has one of its own; the e of 1e3 is none.
export function measure(text, unit) {
  const plain = decimal(text);
  return !plain || !unit || /[a-df-zµ°%]/i.test(plain) ? plain : `${plain} ${unit}`;
}

export const at = (id) => document.getElementById(id);

export function shown(value, digits = 4) {
  if (value == null || Number.isNaN(value)) return "–";
  if (value === 0 || Math.abs(value) < 1e-9) return "0";
  const size = Math.floor(Math.log10(Math.abs(value)));
  return value.toFixed(Math.max(0, Math.min(6, digits - 1 - size)));
}

export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}
