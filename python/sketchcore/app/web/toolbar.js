// The bar on top and the tools at the side. Buttons come from one table (page.py), which the keyboard and the help use too.

const Tool = {
  props: ["action", "pressed", "disabled", "label", "compact"],
  emits: ["run"],
  template: `
    <button type="button" class="tool" :class="{ pressed }" :aria-pressed="pressed === undefined ? null : String(!!pressed)"
            :disabled="disabled" :aria-label="action.label" :aria-keyshortcuts="action.keys[0] || null"
            :data-action="action.name" :data-tip="action.label + (action.keys.length ? '  ' + keyNames : '')"
            @click="$emit('run', action.name)">
      <i class="material-symbols-outlined" aria-hidden="true">{{ action.icon }}</i>
      <span v-if="label">{{ label }}</span>
    </button>`,
  computed: {
    keyNames() {
      return this.action.keys.slice(0, 1).map(keyName).join("");
    },
  },
};

export function keyName(key) {
  const mac = navigator.platform?.startsWith("Mac");
  const names = { Control: mac ? "⌘" : "Ctrl", Shift: "Shift", Space: "Space", Enter: "Enter", Escape: "Esc" };
  return key
    .split("+")
    .map((part) => names[part] ?? (part.length === 1 ? part.toUpperCase() : part))
    .join(" ");
}

export const TopBar = {
  components: { Tool },
  props: ["actions", "now", "ui"],
  emits: ["run", "call"],
  template: `
    <header class="topbar">
      <div class="left">
        <tool :action="actions.sessions" @run="run" />
        <label class="sessionname"><span class="unseen">Name of this session</span>
          <input :value="now.state.name" maxlength="80" spellcheck="false" @change="$emit('call', $event.target)"
                 @keydown.enter="$event.target.blur()" @keydown.esc="$event.target.value = now.state.name; $event.target.blur()" />
        </label>
        <span class="status" role="status" :data-online="String(now.online)">
          <template v-if="!now.online"><i class="material-symbols-outlined" aria-hidden="true">cloud_off</i>
            <span>Server away: your lines are kept here</span></template>
          <template v-else-if="now.waiting"><span>Saving</span></template>
          <template v-else><span>Saved</span></template>
        </span>
      </div>
      <div class="modes" role="radiogroup" aria-label="Mode">
        <button v-for="name in ['draw', 'navigate']" :key="name" type="button" role="radio" :data-action="name"
                :aria-label="name === 'draw' ? 'Draw' : 'Navigate'" :aria-keyshortcuts="actions[name].keys[0]"
                :aria-checked="String(ui.mode === name)" :class="{ pressed: ui.mode === name }"
                :data-tip="actions[name].label + '  ' + key(actions[name])" @click="run(name)">
          <i class="material-symbols-outlined" aria-hidden="true">{{ actions[name].icon }}</i>
          <span>{{ name === 'draw' ? 'Draw' : 'Navigate' }}</span>
        </button>
      </div>
      <div class="right">
        <tool :action="actions.undo" :disabled="!now.state.can_undo && !now.waiting" @run="run" />
        <tool :action="actions.redo" :disabled="!now.state.can_redo" @run="run" />
        <button type="button" class="primary" data-action="reconstruct" :disabled="!ready" :class="{ busy, stale: now.state.stale }"
                :aria-busy="String(busy)" :aria-label="text" aria-keyshortcuts="Enter" :data-tip="actions.reconstruct.label + '  ' + key(actions.reconstruct)" @click="run('reconstruct')">
          <span class="fill" :style="{ transform: 'scaleX(' + share + ')' }" aria-hidden="true"></span>
          <i class="material-symbols-outlined" aria-hidden="true">deployed_code</i>
          <span class="text">{{ text }}</span>
        </button>
        <tool :action="actions.theme" @run="run" />
        <tool :action="actions.help" @run="run" />
        <tool :action="actions.panel" :pressed="ui.panel" @run="run" />
      </div>
    </header>`,
  computed: {
    busy() {
      return this.now.state.progress.working || this.now.state.progress.waiting;
    },
    ready() {
      return this.now.state.sheets.some((sheet) => sheet.ink) || this.now.waiting > 0;
    },
    share() {
      const { round, rounds, working } = this.now.state.progress;
      return working ? (round + 1) / (rounds + 1) : 0;
    },
    text() {
      const { round, rounds, working, waiting } = this.now.state.progress;
      if (working) return round ? `Round ${round} of ${rounds}` : "First look";
      return waiting ? "In the queue" : "Reconstruct";
    },
  },
  methods: {
    run(name) {
      this.$emit("run", name);
    },
    key(action) {
      return action.keys.slice(0, 1).map(keyName).join("");
    },
  },
};

export const Palette = {
  components: { Tool },
  props: ["actions", "ui"],
  emits: ["run"],
  template: `
    <div class="palette aside" role="toolbar" aria-label="Drawing tools" aria-orientation="vertical">
      <tool v-for="name in ['pen', 'construction', 'ellipse', 'eraser']" :key="name" :action="actions[name]"
            :pressed="ui.tool === name" @run="$emit('run', $event)" />
      <div v-if="ui.tool === 'ellipse'" class="axes" role="radiogroup" aria-label="Axis of the ellipse guide">
        <button v-for="axis in ['x', 'y', 'z']" :key="axis" type="button" role="radio" :aria-checked="String(ui.axis === axis)"
                :class="{ pressed: ui.axis === axis }" :data-action="'axis-' + axis"
                :aria-label="{ x: 'Axis front to back', y: 'Upright axis', z: 'Axis left to right' }[axis]"
                :data-tip="{ x: 'Axis front to back', y: 'Upright axis', z: 'Axis left to right' }[axis]"
                @click="$emit('run', 'axis-' + axis)">{{ axis }}</button>
        <button type="button" :aria-pressed="String(ui.kind === 'construction')" :class="{ pressed: ui.kind === 'construction' }"
                class="kind" data-action="kind" aria-label="Lay the ellipse down as a construction line"
                data-tip="As a construction line" @click="$emit('run', 'kind')"></button>
      </div>
      <hr />
      <tool :action="actions.ruler" :pressed="ui.ruler" @run="$emit('run', $event)" />
      <tool :action="actions.clear" @run="$emit('run', $event)" />
      <tool :action="actions.photo" @run="$emit('run', $event)" />
    </div>`,
};
