// What the browser remembers: theme, the sessions last seen, where one was when the page was left.

const KEYS = { theme: "sketchcore.theme", recent: "sketchcore.recent", welcome: "sketchcore.welcomed", left: "sketchcore.left" };

function read(storage, key, otherwise) {
  try {
    return JSON.parse(storage.getItem(key)) ?? otherwise;
  } catch {
    return otherwise;
  }
}

function write(storage, key, value) {
  try {
    storage.setItem(key, JSON.stringify(value));
  } catch {
    // A browser that keeps nothing: so be it.
  }
}

/** "light" or "dark": what was chosen, else what the system prefers; chooses it when given. */
export function theme(chosen) {
  if (chosen) write(localStorage, KEYS.theme, chosen);
  return read(localStorage, KEYS.theme, null) ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
}

/** Sessions seen in this browser, the last one first: [{id, name, changed}]. */
export function recent() {
  return read(localStorage, KEYS.recent, []);
}

export function remember({ id, name }) {
  const list = [{ id, name, changed: new Date().toISOString() }, ...recent().filter((one) => one.id !== id)].slice(0, 20);
  write(localStorage, KEYS.recent, list);
  return list;
}

export function welcomed() {
  return read(localStorage, KEYS.welcome, false);
}

export function welcome() {
  write(localStorage, KEYS.welcome, true);
}

/** Where one was in this tab, so that a reload looks as if nothing had happened. */
export function leave(place) {
  if (place) write(sessionStorage, KEYS.left, place);
}

export function left() {
  return read(sessionStorage, KEYS.left, null);
}
