// Mouse, pen and fingers on the stage. One finger or the pen draws where one draws, two fingers turn and zoom; once a pen
// has been seen fingers only turn, so that a resting hand leaves no lines.

const TURN = 0.4; // degrees a CSS pixel
const SECOND = 250; // milliseconds within which a second finger means that the first did not mean to draw

export class Pointers {
  constructor(root, stage) {
    this.root = root;
    this.stage = stage;
    this.down = new Map(); // pointer id -> {x, y}
    this.live = null; // what is being drawn: see Stage.begin
    this.at = null; // of the cursor, pixels of the drawing
    this.latency = []; // milliseconds from a pointer's event to its ink, of the last moves
    const on = (name, handle, options) => root.addEventListener(name, handle, options);
    on("pointerdown", (event) => this.press(event));
    on("pointermove", (event) => this.move(event));
    on("pointerrawupdate", (event) => this.draw(event, true)); // at once, where moves wait for the next frame
    on("pointerup", (event) => this.release(event));
    on("pointercancel", (event) => this.release(event, true));
    on("pointerleave", () => this.leave());
    on("contextmenu", (event) => event.preventDefault());
    on("wheel", (event) => this.wheel(event), { passive: false });
    window.addEventListener("keydown", (event) => event.key === "Shift" && this.rule(true));
    window.addEventListener("keyup", (event) => event.key === "Shift" && this.rule(false));
  }

  press(event) {
    if (event.target.closest("button, input, .aside")) return;
    this.root.focus({ preventScroll: true });
    this.root.setPointerCapture(event.pointerId);
    this.down.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (event.pointerType === "pen") this.penSeen = true;
    const palm = event.pointerType === "touch" && this.penSeen;
    if (this.down.size > 1) {
      if (this.live && performance.now() - this.pressed > SECOND) return;
      this.cancel();
      this.stage.navigate();
      return;
    }
    this.pressed = performance.now();
    this.raw = false;
    if (this.stage.mode === "draw" && (event.button === 2 || event.button === 1 || palm)) this.stage.navigate();
    if (this.stage.mode !== "draw") return;
    event.preventDefault();
    this.at = this.stage.toDrawing(event);
    this.live = this.stage.begin(this.at, pressure(event), event.button === 5);
    this.live.id = event.pointerId;
    this.stage.lay(this.live);
    this.note(event);
  }

  /** Raw events come before the move that sums them up; where a browser has them the moves add nothing. */
  draw(event, raw = false) {
    if (!this.live || event.pointerId !== this.live.id) return false;
    this.raw ||= raw;
    if (this.raw !== raw) return true;
    const ruled = event.shiftKey || this.stage.ruler;
    const events = event.getCoalescedEvents?.() ?? [];
    for (const one of events.length ? events : [event])
      this.stage.extend(this.live, this.stage.toDrawing(one), pressure(one), ruled);
    this.stage.lay(this.live);
    this.note(event);
    return true;
  }

  move(event) {
    const before = this.down.get(event.pointerId);
    if (!this.draw(event) && before && this.stage.mode !== "draw") {
      const [dx, dy] = [event.clientX - before.x, event.clientY - before.y];
      this.turning = true;
      if (this.down.size === 1) this.stage.turn(dx * TURN, dy * TURN);
      else this.pinch(event, dx, dy);
    }
    if (before) Object.assign(before, { x: event.clientX, y: event.clientY });
    this.at = event.pointerType === "touch" && !this.live ? null : this.stage.toDrawing(event);
    this.aim();
  }

  pinch(event, dx, dy) {
    const other = [...this.down].find(([id]) => id !== event.pointerId)[1];
    const before = this.down.get(event.pointerId);
    const was = Math.hypot(before.x - other.x, before.y - other.y);
    const is = Math.hypot(event.clientX - other.x, event.clientY - other.y);
    this.stage.turn((dx * TURN) / 2, (dy * TURN) / 2);
    if (was > 10 && is > 10) this.stage.zoom(was / is);
  }

  release(event, cancelled = false) {
    this.down.delete(event.pointerId);
    if (!this.down.size) this.turning = false;
    if (!this.live || event.pointerId !== this.live.id) return;
    if (cancelled) return this.cancel();
    const live = this.live;
    this.live = null;
    this.stage.end(live, event.pointerType === "mouse" ? this.at : null);
  }

  /** Forgets what is being drawn. */
  cancel() {
    if (!this.live) return;
    this.live = null;
    this.stage.redraw();
    this.stage.hover(null);
  }

  leave() {
    if (this.live) return;
    this.at = null;
    this.aim();
  }

  rule(ruled) {
    if (!this.live?.stroke || this.stage.ruler || !this.at) return;
    this.stage.extend(this.live, this.at, 0.5, ruled);
    this.stage.lay(this.live);
    this.aim();
  }

  wheel(event) {
    if (event.target.closest(".aside")) return;
    event.preventDefault();
    if (this.stage.mode === "draw") this.stage.resizeTool(Math.exp(-event.deltaY / 600));
    else this.stage.zoom(Math.exp(event.deltaY / 900));
  }

  // The guides follow once a frame: ink comes first.
  aim() {
    if (this.aiming) return;
    this.aiming = true;
    requestAnimationFrame(() => {
      this.aiming = false;
      const { live } = this;
      this.stage.hover(this.at, live?.ruled ?? (live?.circle ? live : null));
    });
  }

  note(event) {
    this.latency.push(performance.now() - event.timeStamp);
    if (this.latency.length > 500) this.latency.shift();
  }
}

function pressure(event) {
  return event.pointerType === "pen" && event.pressure > 0 ? event.pressure : 0.5;
}
