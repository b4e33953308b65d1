// An order and its answer: until the rig has answered, its place on the page says that it is asked, and for how long.

import { at } from "./link.js";

const SEEN = 300; // ms after which an order without an answer is shown
const LATE = 5000; // ms between two words on an order that waits
export const READ = 9000; // ms in which a text is read
let count = 0;

// Shows a text as an answer, as what is "asked" or as what is "refused"; the same one is not read out again.
export function say(where, text, kind = "") {
  if (where.textContent !== text) where.textContent = text;
  where.dataset.kind = kind;
}

// Gives an order and shows its answer in an element, where of orders that wait the last one counts; returns whether it was done.
// ``control`` is what was pressed, ``quiet`` leaves the words of success out, ``begun`` is shown when the rig has accepted what takes time.
export async function order(link, where, what, more = {}, { control = null, quiet = false, begun = "" } = {}) {
  const number = (where.dataset.order = String(++count));
  const since = performance.now();
  const waits = (text) => where.dataset.order === number && say(where, text, "asked");
  const wait = () => {
    const late = Math.floor((performance.now() - since) / LATE) * (LATE / 1000);
    waits(late ? `asked; the rig has not answered for ${late} s` : "asked");
  };
  const timers = [setTimeout(wait, SEEN), setInterval(wait, LATE + 20)];
  const answered = () => timers.forEach(clearInterval);
  control?.setAttribute("aria-busy", "true");
  try {
    const answer = await link.ask(what, more, () => {
      answered();
      waits(begun);
    });
    say(where, quiet ? "" : answer);
    return true;
  } catch (error) {
    say(where, error.message, "refused");
    return false;
  } finally {
    answered();
    control?.removeAttribute("aria-busy");
  }
}

// The same for what stands in the header, whose words go when they have been read.
export async function orderAbove(link, what, control) {
  const where = at("said");
  const answered = order(link, where, what, {}, { control });
  const number = where.dataset.order;
  await answered;
  setTimeout(() => where.dataset.order === number && say(where, ""), READ);
}
