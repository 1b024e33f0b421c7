// The panel at the side: viewpoints, drawings, parts, the solid.

import { Paper } from "./ink.js";
import { placeOf, unpack } from "./camera.js";

/** A small picture of a drawing, kept up to date. */
const Thumbnail = {
  props: ["strokes", "theme"],
  template: `<canvas class="thumbnail" width="144" height="144" aria-hidden="true"></canvas>`,
  mounted() {
    this.draw();
  },
  watch: { strokes: "draw", theme: "draw" },
  methods: {
    draw() {
      const paper = new Paper(this.$el);
      paper.scale = this.$el.width / 256;
      const style = getComputedStyle(this.$el);
      const token = (name) => style.getPropertyValue(`--${name}`).trim();
      paper.colours = { ink: token("ink"), construction: token("construction") };
      paper.clear();
      for (const stroke of this.strokes) paper.stroke(stroke);
    },
  },
};

// From above: the front points down, towards the reader. Three-quarter views stand on the outer ring, the straight ones on
// the inner one, the top view in the middle.
const Views = {
  props: ["viewpoints", "labels", "allowed", "inked", "current", "advised"],
  emits: ["choose"],
  template: `
    <div class="views" role="radiogroup" aria-label="Viewpoint to draw from" @keydown="arrow">
      <svg viewBox="-100 -100 200 200" aria-hidden="true">
        <circle r="86" /><circle r="48" class="inner" /><rect x="-15" y="-15" width="30" height="30" rx="3" />
        <text y="74">front</text>
      </svg>
      <button v-for="view in places" :key="view.name" type="button" role="radio" :data-view="view.name"
              :aria-checked="String(view.name === current)" :disabled="!allowed.includes(view.name)"
              :tabindex="view.name === (current || allowed[0]) ? 0 : -1" :aria-label="describe(view.name)"
              :data-tip="describe(view.name)" :style="{ left: view.x + '%', top: view.y + '%' }"
              :class="{ pressed: view.name === current, inked: inked.includes(view.name), advised: view.name === advised, quarter: view.quarter }"
              @click="$emit('choose', view.name)"></button>
    </div>`,
  computed: {
    places() {
      return Object.entries(this.viewpoints).map(([name, row]) => {
        const { azimuth } = placeOf(unpack(row));
        const quarter = name.startsWith("quarter");
        const radius = quarter ? 43 : name === "top" ? 0 : 24;
        const angle = (azimuth * Math.PI) / 180; // the front, +x, points down; its right, +z, is at the left
        return { name, quarter, x: 50 - radius * Math.sin(angle), y: 50 + radius * Math.cos(angle) };
      });
    },
  },
  methods: {
    describe(name) {
      const notes = [this.labels[name]];
      if (this.inked.includes(name)) notes.push("has a drawing");
      if (name === this.advised) notes.push("would help most");
      if (!this.allowed.includes(name)) notes.push("after a three-quarter drawing");
      return notes.join(", ");
    },
    arrow(event) {
      const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      const order = this.places.filter((view) => this.allowed.includes(view.name)).map((view) => view.name);
      const at = order.indexOf(document.activeElement.dataset.view);
      const next = order[(at + step + order.length) % order.length];
      this.$el.querySelector(`[data-view="${next}"]`).focus();
      this.$emit("choose", next);
    },
  },
};

const Placement = {
  props: ["part"],
  emits: ["place"],
  template: `
    <div class="placement">
      <label v-for="(name, i) in ['Front', 'Up', 'Right']" :key="name"><span>{{ name }}</span>
        <input type="range" min="-0.6" max="0.6" step="0.01" :value="part.placement.center[i]" @change="move(i, +$event.target.value)" />
        <output>{{ part.placement.center[i].toFixed(2) }}</output></label>
      <label><span>Size</span>
        <input type="range" min="0.1" max="2" step="0.01" :value="part.placement.scale" @change="change({ scale: +$event.target.value })" />
        <output>{{ part.placement.scale.toFixed(2) }}</output></label>
      <div class="row">
        <button type="button" class="plain" @click="change({ turn: (part.placement.turn + 1) % 4 })">
          <i class="material-symbols-outlined" aria-hidden="true">rotate_90_degrees_ccw</i>Quarter turn</button>
        <button type="button" class="plain" @click="change({ center: [0, 0, 0], scale: 1, turn: 0 })">Reset</button>
      </div>
    </div>`,
  methods: {
    move(axis, value) {
      this.change({ center: this.part.placement.center.map((old, i) => (i === axis ? value : old)) });
    },
    change(some) {
      this.$emit("place", { ...this.part.placement, ...some });
    },
  },
};

export const Panel = {
  components: { Thumbnail, Views, Placement },
  props: ["now", "ui", "viewpoints", "labels", "allowed", "inked"],
  emits: ["choose", "change", "doubt", "export", "run"],
  data: () => ({ placing: null }),
  template: `
    <aside class="panel aside" aria-label="Views, drawings and parts" v-show="ui.panel">
      <section aria-labelledby="h-views">
        <h2 id="h-views">Viewpoint</h2>
        <views :viewpoints="viewpoints" :labels="labels" :allowed="allowed" :inked="inked" :current="now.viewpoint"
               :advised="now.advice?.viewpoint" @choose="$emit('choose', $event)"></views>
        <p class="current" role="status">{{ now.viewpoint ? labels[now.viewpoint] : 'Turning freely' }}</p>
        <div v-if="now.advice && now.advice.viewpoint !== now.viewpoint" class="advice">
          <i class="material-symbols-outlined" aria-hidden="true">lightbulb</i>
          <p>A drawing from {{ phrase(now.advice.viewpoint) }} would help most.
            <button type="button" class="link" data-action="advised" @click="$emit('choose', now.advice.viewpoint)">Go there</button></p>
        </div>
      </section>
      <section aria-labelledby="h-drawings">
        <h2 id="h-drawings">Drawings</h2>
        <p v-if="!now.state.sheets.length" class="nothing">Draw the object from this corner view. More drawings from other sides can follow.</p>
        <ul class="drawings">
          <li v-for="sheet in now.state.sheets" :key="sheet.viewpoint" :class="{ pressed: sheet.viewpoint === now.viewpoint }" :data-sheet="sheet.viewpoint">
            <button type="button" class="open" :aria-label="'Edit the drawing: ' + labels[sheet.viewpoint]" @click="$emit('choose', sheet.viewpoint)">
              <thumbnail :strokes="sheet.strokes" :theme="ui.theme"></thumbnail><span>{{ short(sheet.viewpoint) }}</span></button>
            <button type="button" class="remove" :aria-label="'Delete the drawing: ' + labels[sheet.viewpoint]" data-tip="Delete"
                    @click="$emit('change', 'delete_sheet', { viewpoint: sheet.viewpoint })">
              <i class="material-symbols-outlined" aria-hidden="true">delete</i></button>
          </li>
        </ul>
      </section>
      <section aria-labelledby="h-parts">
        <h2 id="h-parts">Parts</h2>
        <ul class="parts">
          <li v-for="part in now.state.parts" :key="part.id" :data-part="part.id">
            <div class="row">
              <button type="button" class="icon" :aria-pressed="String(part.visible)" :aria-label="(part.visible ? 'Hide ' : 'Show ') + part.name"
                      :data-tip="part.visible ? 'Hide' : 'Show'" @click="$emit('change', 'show', { part: part.id, visible: !part.visible })">
                <i class="material-symbols-outlined" aria-hidden="true">{{ part.visible ? 'visibility' : 'visibility_off' }}</i></button>
              <input class="name" :value="part.name" maxlength="80" spellcheck="false" :aria-label="'Name of ' + part.name"
                     @change="rename(part, $event.target)" @keydown.enter="$event.target.blur()" />
              <button type="button" class="icon" :aria-expanded="String(placing === part.id)" :aria-label="'Place ' + part.name" data-tip="Place"
                      @click="placing = placing === part.id ? null : part.id">
                <i class="material-symbols-outlined" aria-hidden="true">open_with</i></button>
              <button type="button" class="icon" :aria-label="'Delete ' + part.name" data-tip="Delete"
                      @click="$emit('change', 'delete_part', { part: part.id })">
                <i class="material-symbols-outlined" aria-hidden="true">delete</i></button>
            </div>
            <placement v-if="placing === part.id" :part="part" @place="$emit('change', 'place', { part: part.id, placement: $event })"></placement>
          </li>
          <li class="currentpart" v-if="now.state.solid"><div class="row"><i class="material-symbols-outlined" aria-hidden="true">edit</i>
            <span class="name">Current part</span>
            <button type="button" class="plain" data-action="freeze" :disabled="now.state.stale || now.state.progress.working"
                    data-tip="Keep this shape, draw a new part" @click="$emit('run', 'freeze')">Freeze</button></div></li>
        </ul>
        <p v-if="!now.state.parts.length && !now.state.solid" class="nothing">Freeze a shape to keep it and draw the next part.</p>
      </section>
      <section aria-labelledby="h-solid">
        <h2 id="h-solid">Solid</h2>
        <label class="switch"><input type="checkbox" role="switch" data-action="doubt" :checked="now.doubt" @change="$emit('doubt', $event.target.checked)" />
          <span>Show where the shape is unsure</span></label>
        <div class="exports" role="group" aria-label="Export the mesh">
          <button v-for="suffix in ['glb', 'obj', 'stl', 'ply']" :key="suffix" type="button" class="plain" :data-export="suffix" :disabled="!solid"
                  :aria-label="'Export as ' + suffix.toUpperCase()" @click="$emit('export', suffix)">{{ suffix.toUpperCase() }}</button>
        </div>
      </section>
    </aside>`,
  computed: {
    solid() {
      return this.now.state.solid || this.now.state.parts.some((part) => part.visible);
    },
  },
  methods: {
    short(name) {
      return this.labels[name].replace("Three-quarter, ", "");
    },
    phrase(name) {
      const short = this.short(name).toLowerCase();
      return name.startsWith("quarter") ? `the corner ${short}` : `the ${short}`;
    },
    rename(part, input) {
      const name = input.value.trim();
      if (name) this.$emit("change", "rename", { part: part.id, name });
      else input.value = part.name;
    },
  },
};
