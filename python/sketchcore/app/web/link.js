// The page's connection to the server: changes go out one after the other and are kept until they have arrived, also
// over a reload; what others and the server do comes in as events.

import { newId } from "./ink.js";

const PAUSES = [400, 800, 1600, 3000];

export class Refused extends Error {
  constructor(message, status) {
    super(message);
    this.status = status;
  }
}

/** An answer's JSON. Throws `Refused` for what the server will not do, and TypeError where it cannot be reached. */
export async function request(method, path, body, headers = {}) {
  const plain = body !== undefined && !(body instanceof Blob);
  const response = await fetch(`/api${path}`, {
    method,
    headers: { ...(plain ? { "Content-Type": "application/json" } : {}), ...headers },
    body: plain ? JSON.stringify(body) : body,
  });
  if (response.status >= 500) throw new TypeError(`the server answered ${response.status}`);
  const answer = await response.json().catch(() => ({ error: `the server answered ${response.status}` }));
  if (!response.ok) throw new Refused(answer.error ?? `the server answered ${response.status}`, response.status);
  return answer;
}

/** A volume, uint8 [64, 64, 64]. Its key is made of what is in it, so the browser's cache may keep it. */
export async function volume(session, key) {
  const response = await fetch(`/api/s/${session}/volume/${key}`);
  if (!response.ok) throw new Refused(`the volume ${key} is gone`, response.status);
  const bytes = new Uint8Array(await response.arrayBuffer());
  if (bytes.length !== 64 ** 3) throw new Refused("the volume is not whole", 500);
  return bytes;
}

/** Changes of one session, in order. Each is sent until the server has answered; it knows those it has done already. */
export class Outbox {
  /** @param heard {state(state), refused(error, operation), online(boolean)}, called as things happen. */
  constructor(session, heard) {
    this.session = session;
    this.heard = heard;
    this.key = `sketchcore.outbox.${session}`;
    this.tries = 0;
    try {
      this.operations = JSON.parse(localStorage.getItem(this.key)) ?? [];
    } catch {
      this.operations = [];
    }
    this.drain();
  }

  push(path, body) {
    this.operations.push({ path, body: { ...body, op: newId() } });
    this.keep();
    this.drain();
  }

  keep() {
    try {
      if (this.operations.length) localStorage.setItem(this.key, JSON.stringify(this.operations));
      else localStorage.removeItem(this.key);
    } catch {
      // A full or forbidden storage: what waits is kept in memory alone.
    }
  }

  async drain() {
    if (this.sending || this.closed) return;
    this.sending = true;
    while (this.operations.length && !this.closed) {
      const operation = this.operations[0];
      try {
        const state = await request("POST", `/s/${this.session}/${operation.path}`, operation.body);
        this.done(operation);
        this.heard.online(true);
        this.heard.state(state);
      } catch (error) {
        if (!(error instanceof Refused)) {
          this.heard.online(false);
          const pause = PAUSES[Math.min(this.tries++, PAUSES.length - 1)];
          await new Promise((resolve) => setTimeout(resolve, pause));
          continue;
        }
        this.done(operation);
        this.heard.refused(error, operation);
      }
    }
    this.sending = false;
  }

  done(operation) {
    this.tries = 0;
    this.operations = this.operations.filter((other) => other !== operation);
    this.keep();
  }

  close() {
    this.closed = true;
  }
}

/** The session's events; the browser connects again by itself. */
export function listen(session, { event, online }) {
  const source = new EventSource(`/api/s/${session}/events`);
  source.onmessage = (message) => event(JSON.parse(message.data));
  source.onopen = () => online(true);
  source.onerror = () => online(false);
  return source;
}
