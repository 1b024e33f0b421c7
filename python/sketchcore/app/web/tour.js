// The example that shows the whole way in twenty seconds: it draws, reconstructs, turns, draws again, in a session of its
// own, and leaves everything as it was.

const PEN = 210; // pixels of the drawing a second
const LIFT = 60; // milliseconds between two strokes

export class Tour {
  /** @param desk, stage; say(text): shows what is happening; strokes: [{viewpoint, strokes: [[[x, y], ...], ...]}]. */
  constructor(desk, stage, say, drawings) {
    Object.assign(this, { desk, stage, say, drawings });
    this.stopped = false;
  }

  stop() {
    this.stopped = true;
    this.wake?.();
  }

  async play() {
    const [first, second] = this.drawings;
    await this.scene("1. Draw an object from a corner view.", () => this.draw(first));
    await this.scene("2. Reconstruct: the shape appears, round by round.", () => this.reconstruct());
    await this.scene("3. Look at it from all sides.", () => this.turn(230, 2600));
    await this.scene("4. Draw over it from another side.", () => this.draw(second));
    await this.scene("5. Reconstruct again: it gets better with every drawing.", () => this.reconstruct());
    await this.scene("That is all. Now it is your turn.", () => this.turn(-150, 2200));
  }

  async scene(text, act) {
    if (this.stopped) return;
    this.say(text);
    await act();
  }

  pause(milliseconds) {
    return new Promise((resolve) => {
      if (this.stopped) return resolve();
      this.wake = resolve;
      setTimeout(resolve, milliseconds);
    });
  }

  async until(holds, patience = 20000) {
    const begun = performance.now();
    while (!this.stopped && !holds() && performance.now() - begun < patience) await this.pause(60);
  }

  async draw({ viewpoint, strokes }) {
    this.stage.draw(viewpoint);
    await this.until(() => this.stage.mode === "draw");
    const all = strokes.reduce((sum, line) => sum + length(line), 0);
    const haste = Math.max(1, all / PEN / 5.5); // never more than about five seconds a drawing
    for (const line of strokes) {
      if (this.stopped) return;
      const live = this.stage.begin(line[0], 0.5, false);
      const begun = performance.now();
      const lasts = (length(line) / PEN / haste) * 1000;
      for (let i = 1; i < line.length; ) {
        const share = Math.min(1, (performance.now() - begun) / lasts);
        const until = Math.max(i + 1, Math.ceil(share * line.length));
        for (; i < Math.min(until, line.length); i++) live.stroke.add(...line[i], 0.5);
        this.stage.lay(live);
        this.stage.hover(line[Math.min(i, line.length - 1)]);
        await frame();
      }
      this.stage.heard.stroke(viewpoint, live.stroke.data);
      await this.pause(LIFT / haste);
    }
    this.stage.hover(null);
    await this.until(() => !this.desk.now.waiting);
  }

  async reconstruct() {
    this.desk.reconstruct();
    await this.until(() => {
      const { solid, stale, progress } = this.desk.state;
      return solid && !stale && !progress.working && !progress.waiting;
    });
    await this.pause(500);
  }

  async turn(degrees, milliseconds) {
    this.stage.navigate();
    const begun = performance.now();
    let done = 0;
    for (let share = 0; share < 1 && !this.stopped; ) {
      share = Math.min(1, (performance.now() - begun) / milliseconds);
      const eased = share * share * (3 - 2 * share);
      this.stage.turn((eased - done) * degrees, 0);
      done = eased;
      await frame();
    }
  }
}

function length(line) {
  return line.slice(1).reduce((sum, [x, y], i) => sum + Math.hypot(x - line[i][0], y - line[i][1]), 0);
}

function frame() {
  return new Promise((resolve) => requestAnimationFrame(resolve));
}
