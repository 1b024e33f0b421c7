// The workspace, as NiceGUI mounts it: toolbar, stage, panel and dialogs around one session.

import { reactive } from "vue";
import { Desk } from "sketchcore-app/desk.js";
import { Help, Photo, Sessions } from "sketchcore-app/dialogs.js";
import { Refused, request } from "sketchcore-app/link.js";
import { Panel } from "sketchcore-app/panel.js";
import { Stage } from "sketchcore-app/stage.js";
import { Palette, TopBar } from "sketchcore-app/toolbar.js";
import { Tour } from "sketchcore-app/tour.js";
import * as memory from "sketchcore-app/memory.js";

export default {
  components: { TopBar, Palette, Panel, Help, Photo, Sessions },
  props: { actions: Object, viewpoints: Object, labels: Object, quarters: Array, scenes: Array, example: String },
  template: `
    <div class="workspace" :data-theme="ui.theme" @dragover.prevent @drop.prevent="drop">
      <top-bar v-if="now" :actions="actions" :now="now" :ui="ui" @run="run" @call="call"></top-bar>
      <main class="stage" ref="root" tabindex="0" aria-label="Drawing area and 3D view" data-mode="draw" :data-tool="ui.tool">
        <div class="paper square"></div>
        <canvas class="volume" role="img" aria-label="The reconstructed solid in the wireframe cube of the working volume"></canvas>
        <canvas class="ink square" role="img" aria-label="Your drawing"></canvas>
        <canvas class="guides square" aria-hidden="true"></canvas>
        <palette v-if="now" v-show="ui.mode === 'draw'" :actions="actions" :ui="ui" @run="run"></palette>
        <div v-if="broken" class="broken" role="alert">{{ broken }}</div>
        <div class="notes" aria-live="polite">
          <div v-if="tour" class="note tour"><i class="material-symbols-outlined" aria-hidden="true">play_circle</i><span>{{ tour }}</span>
            <button type="button" class="link" data-action="skip" @click="skip">Skip</button></div>
          <template v-else>
            <div v-if="welcome" class="note tour" data-note="welcome"><i class="material-symbols-outlined" aria-hidden="true">waving_hand</i>
              <span>New here? See how a shape is drawn, in twenty seconds.</span>
              <button type="button" class="link" data-action="tour" @click="play">Show me</button>
              <button type="button" class="icon" aria-label="No, thanks" @click="dismiss"><i class="material-symbols-outlined" aria-hidden="true">close</i></button></div>
            <div v-for="hint in hints" :key="hint" class="note hint"><i class="material-symbols-outlined" aria-hidden="true">info</i><span>{{ hint }}</span>
              <button type="button" class="icon" aria-label="Dismiss" @click="hushed = [...hushed, hint]"><i class="material-symbols-outlined" aria-hidden="true">close</i></button></div>
            <div v-for="message in messages" :key="message.id" class="note" :class="message.kind" :role="message.kind === 'trouble' ? 'alert' : null">
              <i class="material-symbols-outlined" aria-hidden="true">{{ message.kind === 'trouble' ? 'error' : 'check_circle' }}</i><span>{{ message.text }}</span>
              <button type="button" class="icon" aria-label="Dismiss" @click="drop_message(message)"><i class="material-symbols-outlined" aria-hidden="true">close</i></button></div>
          </template>
        </div>
      </main>
      <panel v-if="now" :now="now" :ui="ui" :viewpoints="viewpoints" :labels="labels" :allowed="allowed" :inked="inked"
             @choose="choose" @change="change" @doubt="doubt" @export="save" @run="run"></panel>
      <help v-if="dialog === 'help'" :actions="actions" @close="dialog = null" @tour="play"></help>
      <sessions v-if="dialog === 'sessions'" :now="now" :recent="recent" :scenes="scenes" @close="dialog = null" @open="open" @create="create"
                @load="load" @save="save('file')"></sessions>
      <photo v-if="photo" :file="photo" :labels="labels" :allowed="allowed" :current="now.viewpoint" @close="photo = null" @take="take"></photo>
      <input ref="picker" class="unseen" type="file" accept="image/*" tabindex="-1" aria-hidden="true" @change="picked" />
    </div>`,

  data() {
    return {
      now: null,
      ui: reactive({ mode: "draw", tool: "pen", axis: "y", kind: "ink", ruler: false, panel: window.innerWidth > 860, theme: memory.theme() }),
      dialog: null,
      photo: null,
      tour: null,
      welcome: false,
      broken: null,
      messages: [],
      hushed: [],
      recent: memory.recent(),
    };
  },

  computed: {
    inked() {
      return this.now.state.sheets.filter((sheet) => sheet.ink).map((sheet) => sheet.viewpoint);
    },
    allowed() {
      const free = this.inked.some((name) => this.quarters.includes(name));
      return free ? Object.keys(this.viewpoints) : this.quarters;
    },
    hints() {
      return this.ui.mode === "draw" ? this.now?.hints.filter((hint) => !this.hushed.includes(hint)) ?? [] : [];
    },
  },

  async mounted() {
    this.desk = new Desk(this.quarters, {
      drawing: () => this.show(),
      volume: (bytes) => this.stage?.view.setVolume(bytes),
      unsure: (bytes) => this.stage?.view.setUnsure(bytes),
      say: (text, kind) => this.say(text, kind),
    });
    this.now = this.desk.now;
    try {
      this.stage = new Stage(this.$refs.root, this.viewpoints, {
        stroke: (viewpoint, stroke) => this.desk.do("strokes", { viewpoint, strokes: [stroke] }),
        erase: (viewpoint, path, radius) => this.desk.do("erase", { viewpoint, path, radius }),
        view: (viewpoint) => this.viewed(viewpoint),
      });
    } catch (error) {
      this.broken = error.message;
      return;
    }
    Object.assign(this.$el, { desk: this.desk, stage: this.stage }); // for those who look inside: tests and the curious
    document.addEventListener("keydown", this.pressed);
    document.addEventListener("keyup", this.released);
    document.addEventListener("paste", this.pasted);
    window.addEventListener("popstate", () => this.begin());
    window.addEventListener("beforeunload", () => memory.leave(this.place()));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.paint(memory.theme()));
    this.paint(this.ui.theme);
    await this.begin();
  },

  methods: {
    // Sessions

    async begin() {
      const wanted = location.pathname.match(/^\/s\/([0-9a-f]{32})$/)?.[1] ?? this.recent[0]?.id;
      const left = memory.left();
      try {
        if (!wanted) throw new Refused("", 404);
        await this.desk.open(wanted);
      } catch (error) {
        if (!(error instanceof Refused)) {
          this.say("The server cannot be reached; trying again.", "trouble");
          setTimeout(() => this.begin(), 2000);
          return;
        }
        if (wanted && location.pathname !== "/") this.say("That session is not here any more; this is a new one.", "trouble");
        await this.desk.create();
      }
      this.arrived(left?.id === this.desk.state.id ? left : null);
    },

    arrived(left) {
      const { state } = this.desk;
      history.replaceState(null, "", `/s/${state.id}`);
      this.recent = memory.remember(state);
      this.hushed = [];
      this.welcome = !memory.welcomed() && !state.sheets.length && !state.parts.length;
      if (left?.mode === "navigate") {
        this.stage.navigate();
        this.stage.look(left.place);
      } else {
        const first = state.sheets[0]?.viewpoint ?? this.quarters[0];
        this.stage.draw(this.allowed.includes(left?.viewpoint) ? left.viewpoint : first);
      }
    },

    async open(id, scene = null) {
      this.dialog = null;
      try {
        const chosen = id ?? (await request("POST", `/examples/${scene}`)).id;
        await this.desk.open(chosen);
        history.pushState(null, "", `/s/${chosen}`);
        this.arrived(scene ? { mode: "navigate", place: { azimuth: 40, elevation: 26, distance: 2 } } : null);
      } catch (error) {
        this.say(error.message, "trouble");
      }
    },

    async create() {
      this.dialog = null;
      const id = await this.desk.create();
      history.pushState(null, "", `/s/${id}`);
      this.arrived(null);
    },

    async load(file) {
      try {
        const { id } = await request("POST", "/sessions/import", file);
        await this.open(id);
      } catch (error) {
        this.say(error.message, "trouble");
      }
    },

    call(input) {
      const name = input.value.trim();
      if (name) this.desk.do("call", { name });
      else input.value = this.now.state.name;
    },

    place() {
      const { mode, viewpoint } = this.stage ?? {};
      if (!this.stage || this.tour) return null;
      return { id: this.desk.state.id, mode: mode === "navigate" ? mode : "draw", viewpoint, place: this.stage.place };
    },

    // What can be done

    run(name) {
      const act = this.acts()[name];
      if (act) act();
    },

    acts() {
      const { stage, desk, ui } = this;
      const tool = (name, kind) => () => {
        Object.assign(ui, { tool: name, kind: kind ?? ui.kind });
        Object.assign(stage, { tool: name, kind: ui.kind });
        if (stage.mode === "navigate") this.choose(stage.nearest(this.allowed));
        stage.hover(stage.pointers.at);
      };
      const axis = (name) => () => {
        stage.axis = ui.axis = name;
        stage.hover(stage.pointers.at);
      };
      return {
        draw: () => stage.mode === "navigate" && this.choose(stage.nearest(this.allowed)),
        navigate: () => stage.navigate(),
        switch: () => this.run(stage.mode === "navigate" ? "draw" : "navigate"),
        pen: tool("pen", "ink"),
        construction: tool("construction", "construction"),
        eraser: tool("eraser"),
        ellipse: () => {
          if (ui.tool === "ellipse") axis({ x: "y", y: "z", z: "x" }[ui.axis])();
          else tool("ellipse", ui.kind)();
        },
        "axis-x": axis("x"),
        "axis-y": axis("y"),
        "axis-z": axis("z"),
        kind: () => (stage.kind = ui.kind = ui.kind === "ink" ? "construction" : "ink"),
        ruler: () => (stage.ruler = ui.ruler = !ui.ruler),
        smaller: () => stage.resizeTool(1 / 1.15),
        larger: () => stage.resizeTool(1.15),
        undo: () => desk.do("undo"),
        redo: () => desk.do("redo"),
        clear: () => this.now.viewpoint && desk.do("clear", { viewpoint: this.now.viewpoint }),
        reconstruct: () => (this.inked.length || this.now.waiting) && desk.reconstruct(),
        freeze: () => {
          desk.do("freeze");
          this.say("Kept. Draw the next part; this one stays.", "done");
        },
        doubt: () => this.doubt(!this.now.doubt),
        advised: () => this.now.advice && this.choose(this.now.advice.viewpoint),
        photo: () => this.$refs.picker.click(),
        sessions: () => (this.dialog = "sessions"),
        help: () => (this.dialog = "help"),
        panel: () => (ui.panel = !ui.panel),
        theme: () => this.paint(memory.theme(ui.theme === "dark" ? "light" : "dark")),
      };
    },

    choose(viewpoint) {
      if (this.allowed.includes(viewpoint)) this.stage.draw(viewpoint);
    },

    viewed(viewpoint) {
      this.now.viewpoint = viewpoint;
      this.ui.mode = viewpoint ? "draw" : "navigate";
      this.now.hints = [];
      this.references = [];
      this.show();
      if (!viewpoint) return;
      this.desk.check(700);
      if (!this.now.state.parts.length) return;
      request("GET", `/s/${this.desk.state.id}/reference/${viewpoint}`)
        .then((strokes) => {
          if (this.now.viewpoint !== viewpoint) return;
          this.references = strokes;
          this.show();
        })
        .catch(() => null);
    },

    show() {
      const { viewpoint } = this.now;
      if (this.stage && viewpoint)
        this.stage.show(this.desk.sheet(viewpoint), this.desk.outbox?.operations ?? [], this.references ?? []);
    },

    change(path, body) {
      this.desk.do(path, body);
    },

    doubt(on) {
      this.stage.view.look.doubt = on;
      this.stage.view.invalidate();
      this.desk.doubt(on);
      if (on && this.stage.mode !== "navigate" && this.desk.state.solid) this.stage.navigate();
    },

    save(what) {
      const link = document.createElement("a");
      link.href = what === "file" ? `/api/s/${this.desk.state.id}/file` : `/api/s/${this.desk.state.id}/export.${what}`;
      link.download = "";
      link.click();
    },

    paint(theme) {
      this.ui.theme = theme;
      document.documentElement.dataset.theme = theme;
      this.$nextTick(() => this.stage?.paint());
    },

    say(text, kind = "done") {
      const message = { id: Math.random(), text, kind };
      this.messages = [...this.messages.filter((other) => other.text !== text), message].slice(-3);
      setTimeout(() => this.drop_message(message), kind === "trouble" ? 9000 : 4000);
    },

    drop_message(message) {
      this.messages = this.messages.filter((other) => other.id !== message.id);
    },

    // Images

    picked(event) {
      this.photo = event.target.files[0] ?? null;
      event.target.value = "";
    },

    pasted(event) {
      const file = [...(event.clipboardData?.files ?? [])].find((one) => one.type.startsWith("image/"));
      if (file) this.photo = file;
    },

    drop(event) {
      const file = event.dataTransfer?.files[0];
      if (file?.type.startsWith("image/")) this.photo = file;
      else if (file) this.load(file);
    },

    async take(viewpoint) {
      try {
        const chosen = await this.desk.photo(this.photo, viewpoint);
        this.choose(chosen);
        if (viewpoint === "guess") this.say(`Taken as drawn from: ${this.labels[chosen]}`, "done");
      } catch (error) {
        this.say(error.message, "trouble");
      }
      this.photo = null;
    },

    // The example

    async play() {
      this.dialog = null;
      this.dismiss();
      const own = this.desk.state.id;
      const drawings = await (await fetch(this.example)).json();
      await this.desk.create(true);
      const mine = this.desk.state.id;
      Object.assign(this.ui, { tool: "pen", kind: "ink" });
      Object.assign(this.stage, { tool: "pen", kind: "ink" });
      this.player = new Tour(this.desk, this.stage, (text) => (this.tour = text), drawings);
      try {
        await this.player.play();
      } finally {
        this.tour = null;
        await this.desk.open(own);
        this.arrived(null);
        request("DELETE", `/s/${mine}`).catch(() => null);
      }
    },

    skip() {
      this.player?.stop();
    },

    dismiss() {
      this.welcome = false;
      memory.welcome();
    },

    // Keys

    pressed(event) {
      const field = event.target.closest("input, select, textarea, dialog");
      if (field && field.type !== "checkbox" && field.type !== "range") return;
      if (event.key === " " && !event.target.closest("button, input")) {
        event.preventDefault();
        if (!event.repeat && this.stage.mode === "draw" && !this.stage.pointers.live) {
          this.held = true;
          this.stage.navigate();
        }
        return;
      }
      const arrows = { ArrowLeft: [-5, 0], ArrowRight: [5, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] }[event.key];
      if (arrows && this.stage.mode === "navigate" && event.target.closest(".stage, body") && !field) {
        event.preventDefault();
        this.stage.turn(...arrows);
        return;
      }
      const name = combination(event);
      const action = Object.values(this.actions).find((one) => one.keys.includes(name));
      if (!action || (name === "Enter" && event.target.closest("button"))) return;
      event.preventDefault();
      this.run(action.name);
    },

    released(event) {
      if (event.key !== " " || !this.held) return;
      this.held = false;
      this.run("draw");
    },
  },
};

function combination(event) {
  const control = event.ctrlKey || event.metaKey ? "Control+" : "";
  const shift = event.shiftKey && event.key.length > 1 ? "Shift+" : event.shiftKey && control ? "Shift+" : "";
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  return control + shift + key;
}
