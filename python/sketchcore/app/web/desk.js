// What the page knows of a session, and everything that can be done to it. Reactive: the panels show what is in here.

import { reactive } from "vue";
import { Outbox, Refused, listen, request, volume } from "./link.js";

const FOLLOW = 1100; // milliseconds after the last change of a drawing until the shape follows
const AGAIN = 1500; // milliseconds until what could not be had, a volume or the state, is asked for again
const CHECK = 3000; // milliseconds after the last stroke until the composition is looked at: not while one draws

const EMPTY = {
  id: null,
  name: "",
  revision: -1,
  life: null,
  moment: -1,
  part: null,
  sheets: [],
  parts: [],
  solid: null,
  scene: null,
  stale: false,
  can_undo: false,
  can_redo: false,
  progress: { round: 0, rounds: 0, working: false, waiting: false },
  trouble: "",
};

export class Desk {
  /** @param heard {drawing(), volume(bytes or null), unsure(bytes), say(text, kind)}; quarters: names of three-quarter views. */
  constructor(quarters, heard) {
    this.quarters = quarters;
    this.heard = heard;
    this.now = reactive({
      state: structuredClone(EMPTY),
      online: true,
      waiting: 0, // changes that have not arrived yet
      hints: [],
      advice: null,
      doubt: false,
      viewpoint: null, // that one draws from; null while navigating
      shownAt: 0, // when a volume was last put on the screen
    });
    this.included = new Set(); // viewpoints whose drawings the solid was made from
  }

  get state() {
    return this.now.state;
  }

  // Sessions

  /** Goes to a session; the one that is left is deleted if nothing was ever done in it, but for `keep`. */
  async open(id, keep = false) {
    const state = await request("GET", `/s/${id}`);
    this.close();
    const { state: left } = this;
    if (!keep && left.id && left.id !== id && left.revision === 0 && !this.now.waiting)
      request("DELETE", `/s/${left.id}`).catch(() => null);
    this.now.state = state;
    this.told = null;
    this.loaded = null;
    this.included = new Set(state.stale ? [] : this.inked);
    Object.assign(this.now, { hints: [], advice: null, online: true });
    this.outbox = new Outbox(id, {
      state: (next) => this.take(next),
      online: (online) => this.reach(online),
      refused: (error) => this.refuse(error),
    });
    this.now.waiting = this.outbox.operations.length;
    this.source = listen(id, { event: (event) => this.hear(event), online: (online) => this.reach(online) });
    this.heard.drawing();
    this.loadScene();
    if (state.solid) this.advise();
  }

  async create(keep = false) {
    const { id } = await request("POST", "/sessions");
    await this.open(id, keep);
    return id;
  }

  close() {
    this.outbox?.close();
    this.source?.close();
    clearTimeout(this.following);
    clearTimeout(this.checking);
    clearTimeout(this.refreshing);
    this.refreshing = null;
  }

  // Changes

  do(path, body = {}) {
    if (!this.outbox) return;
    this.outbox.push(path, body);
    this.now.waiting = this.outbox.operations.length;
    if (path === "strokes" || path === "erase") this.heard.drawing();
  }

  reconstruct() {
    clearTimeout(this.following);
    this.do("reconstruct");
    this.check(0);
  }

  async photo(file, viewpoint) {
    const state = await request("POST", `/s/${this.state.id}/photo?viewpoint=${viewpoint}`, file);
    this.take(state);
    return state.viewpoint;
  }

  // What comes back

  // Answers and events overtake each other on their ways, so each says how late it is: of what is known the latest
  // counts, and where an event tells of a revision that no answer has brought, the state is asked for.

  take(state) {
    if (state.id !== this.state.id) return;
    this.now.waiting = this.outbox.operations.length;
    if (!this.overtaken(state)) {
      const before = this.state;
      this.now.state = state;
      if (!this.told || this.told.life !== state.life || this.told.revision < state.revision) this.told = state;
      if (!state.stale) this.included = new Set(this.inked);
      this.heard.drawing();
      this.loadScene();
      if (JSON.stringify(state.sheets) !== JSON.stringify(before.sheets)) {
        this.follow();
        this.check();
      }
      this.finish(before, state);
    }
    if (this.behind) this.refresh();
  }

  hear(event) {
    if (this.overtaken(event)) return;
    const before = { ...this.state };
    const { revision, life, moment, solid, scene, stale, trouble, ...progress } = event;
    this.told = { revision, life };
    if (life === before.life) {
      Object.assign(this.state, { moment, scene, solid, trouble, progress });
      this.loadScene();
      if (!this.behind) this.state.stale = stale;
      this.finish(before, this.state);
    }
    if (this.behind && !this.outbox.operations.length) this.refresh(); // else an answer is on its way
  }

  overtaken({ life, moment }) {
    return life === this.state.life && moment < this.state.moment;
  }

  get behind() {
    return this.told && (this.told.life !== this.state.life || this.told.revision !== this.state.revision);
  }

  // Something else changed the session: a round of the reconstruction, another page.
  refresh(soon = 60) {
    if (this.refreshing) return;
    const { id } = this.state;
    this.refreshing = setTimeout(async () => {
      const state = await request("GET", `/s/${id}`).catch(() => null);
      this.refreshing = null;
      if (state) this.take(state);
      else if (this.behind && this.now.online && id === this.state.id) this.refresh(AGAIN);
    }, soon);
  }

  finish(before, state) {
    if (state.trouble && state.trouble !== before.trouble) this.heard.say(state.trouble, "trouble");
    if (before.progress.working && !state.progress.working && state.solid) this.advise();
    if (!state.solid) this.now.advice = null;
  }

  refuse(error) {
    this.now.waiting = this.outbox.operations.length;
    this.heard.say(error.message, "trouble");
    this.refresh();
  }

  reach(online) {
    if (online && !this.now.online) this.refresh();
    this.now.online = online;
  }

  // The solid

  async loadScene() {
    const { state } = this;
    const wanted = state.solid || state.parts.some((part) => part.visible) ? state.scene : "none";
    if (wanted === this.loaded || this.loading) return;
    this.loading = true;
    try {
      const bytes = wanted === "none" ? null : await volume(state.id, `scene?of=${wanted}`);
      this.loaded = wanted;
      this.heard.volume(bytes);
      this.now.shownAt = performance.now();
      if (bytes && this.now.doubt) this.heard.unsure(await volume(state.id, `unsure?of=${wanted}`));
    } catch (error) {
      if (error instanceof Refused) this.loaded = wanted;
      else setTimeout(() => this.loadScene(), AGAIN);
    }
    this.loading = false;
    if (this.loaded !== wanted) return;
    const { state: next } = this;
    const current = next.solid || next.parts.some((part) => part.visible) ? next.scene : "none";
    if (current !== this.loaded && this.now.online) this.loadScene();
  }

  async doubt(on) {
    this.now.doubt = on;
    if (on && this.loaded && this.loaded !== "none")
      this.heard.unsure(await volume(this.state.id, `unsure?of=${this.loaded}`));
  }

  async advise() {
    try {
      this.now.advice = await request("GET", `/s/${this.state.id}/advice`);
    } catch {
      this.now.advice = null;
    }
  }

  // Of drawings that are in the shape already a change is followed by itself; a new one is waited for.
  follow() {
    clearTimeout(this.following);
    const { state } = this;
    if (!state.stale || !state.solid || !this.inked.every((name) => this.included.has(name))) return;
    this.following = setTimeout(() => this.state.stale && this.reconstruct(), FOLLOW);
  }

  check(soon = CHECK) {
    clearTimeout(this.checking);
    const { viewpoint } = this.now;
    if (!viewpoint) return;
    this.checking = setTimeout(async () => {
      try {
        this.now.hints = await request("GET", `/s/${this.state.id}/hints/${viewpoint}`);
      } catch {
        this.now.hints = [];
      }
    }, soon);
  }

  // Questions

  get inked() {
    return this.state.sheets.filter((sheet) => sheet.ink).map((sheet) => sheet.viewpoint);
  }

  sheet(viewpoint) {
    return this.state.sheets.find((sheet) => sheet.viewpoint === viewpoint)?.strokes ?? [];
  }

  /** Viewpoints that one may draw from: three-quarter ones first. */
  allowed(all) {
    return this.inked.some((name) => this.quarters.includes(name)) ? all : this.quarters;
  }
}
