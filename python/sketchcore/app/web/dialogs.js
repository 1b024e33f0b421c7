// Dialogs: help, sessions, a photo's viewpoint. The browser's own <dialog> keeps the focus inside and closes on Escape.

import { keyName } from "./toolbar.js";
import { request } from "./link.js";

const Sheet = {
  props: ["title", "wide"],
  emits: ["close"],
  template: `
    <dialog class="sheet" :class="{ wide }" :aria-label="title" @close="$emit('close')" @click.self="$el.close()">
      <div class="head"><h2>{{ title }}</h2>
        <button type="button" class="icon" aria-label="Close" @click="$el.close()"><i class="material-symbols-outlined" aria-hidden="true">close</i></button></div>
      <div class="body"><slot></slot></div>
    </dialog>`,
  mounted() {
    this.$el.showModal();
  },
};

export const Help = {
  components: { Sheet },
  props: ["actions"],
  emits: ["close", "tour"],
  template: `
    <sheet title="How it works" :wide="true" @close="$emit('close')">
      <ol class="steps">
        <li><b>Draw</b> the lines of an object inside the cube, from a corner view. Blue lines through the pen show where edges vanish;
          hold <kbd>Shift</kbd> for a straight line along them.</li>
        <li><b>Reconstruct.</b> The shape appears, and gets better round by round.</li>
        <li><b>Navigate</b> to look at it from all sides. Switch back to Draw: the view turns to the nearest viewpoint, the shape stays as a faint reference.</li>
        <li><b>Draw over it</b> from there, and reconstruct again. Every drawing makes it better.</li>
      </ol>
      <p><button type="button" class="plain" @click="$emit('tour'); $el.parentNode.querySelector('dialog')?.close()">
        <i class="material-symbols-outlined" aria-hidden="true">play_arrow</i>Play the example</button></p>
      <h3>Keys</h3>
      <dl class="keys">
        <template v-for="action in listed" :key="action.name">
          <div><dt>{{ action.label }}</dt><dd><kbd v-for="key in action.keys" :key="key">{{ name(key) }}</kbd></dd></div>
        </template>
        <div><dt>Straight line</dt><dd><kbd>Shift</kbd> drag</dd></div>
        <div><dt>Turn, in Draw</dt><dd>right drag, two fingers</dd></div>
        <div><dt>Turn, in Navigate</dt><dd>drag, arrow keys</dd></div>
        <div><dt>Closer, farther</dt><dd>wheel, pinch</dd></div>
      </dl>
    </sheet>`,
  computed: {
    listed() {
      return Object.values(this.actions).filter((action) => action.keys.length);
    },
  },
  methods: { name: keyName },
};

export const Sessions = {
  components: { Sheet },
  props: ["now", "recent", "scenes"],
  emits: ["close", "open", "create", "load", "save"],
  data: () => ({ listed: [] }),
  template: `
    <sheet title="Sessions" @close="$emit('close')">
      <div class="row wrap">
        <button type="button" class="plain" data-action="new" @click="$emit('create')"><i class="material-symbols-outlined" aria-hidden="true">add</i>New</button>
        <label class="plain file"><i class="material-symbols-outlined" aria-hidden="true">upload_file</i>Open a file
          <input type="file" accept=".sketchcore,.zip" @change="$emit('load', $event.target.files[0])" /></label>
        <button type="button" class="plain" data-action="save" @click="$emit('save')"><i class="material-symbols-outlined" aria-hidden="true">download</i>Save as a file</button>
      </div>
      <template v-if="scenes.length">
        <h3>Examples</h3>
        <ul class="sessions"><li v-for="scene in scenes" :key="scene.name">
          <button type="button" :data-scene="scene.name" @click="$emit('open', null, scene.name)"><b>{{ scene.label }}</b></button></li></ul>
      </template>
      <h3>Saved here</h3>
      <p v-if="!listed.length" class="nothing">Everything you draw is saved by itself, and will be listed here.</p>
      <ul class="sessions">
        <li v-for="one in listed" :key="one.id" :class="{ pressed: one.id === now.state.id }">
          <button type="button" :data-session="one.id" @click="$emit('open', one.id)"><b>{{ one.name }}</b><time :datetime="one.changed">{{ when(one.changed) }}</time></button>
          <button type="button" class="icon" v-if="one.id !== now.state.id" :aria-label="'Delete ' + one.name" data-tip="Delete for good" @click="remove(one)">
            <i class="material-symbols-outlined" aria-hidden="true">delete</i></button>
        </li>
      </ul>
    </sheet>`,
  async mounted() {
    const listed = await request("GET", "/sessions").catch(() => []);
    const known = new Set(listed.map((one) => one.id));
    this.listed = [...listed, ...this.recent.filter((one) => !known.has(one.id))].filter(
      (one) => one.id === this.now.state.id || one.used !== false,
    );
  },
  methods: {
    when(text) {
      return new Date(text).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" });
    },
    async remove(one) {
      await request("DELETE", `/s/${one.id}`).catch(() => null);
      this.listed = this.listed.filter((other) => other !== one);
    },
  },
};

export const Photo = {
  components: { Sheet },
  props: ["file", "labels", "allowed", "current"],
  emits: ["close", "take"],
  data() {
    return { viewpoint: this.current ?? "guess", url: URL.createObjectURL(this.file), busy: false };
  },
  template: `
    <sheet title="Import a drawing" @close="$emit('close')">
      <img class="photo" :src="url" alt="The image to import" />
      <label class="field"><span>Drawn from</span>
        <select v-model="viewpoint"><option value="guess">Guess a three-quarter view</option>
          <option v-for="name in allowed" :key="name" :value="name">{{ labels[name] }}</option></select></label>
      <p class="nothing">It is cleaned, cropped and traced into lines that you can edit; it takes the place of what is drawn from there.</p>
      <div class="row end"><button type="button" class="primary" :disabled="busy" :aria-busy="String(busy)" data-action="take" @click="busy = true; $emit('take', viewpoint)">{{ busy ? 'Reading' : 'Import' }}</button></div>
    </sheet>`,
  beforeUnmount() {
    URL.revokeObjectURL(this.url);
  },
};
