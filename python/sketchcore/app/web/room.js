// What the ray caster needs to know of a volume before it walks through it: where there is surface to meet, how far
// off it is elsewhere, and the shadow that the solid casts on the ground.

export const SIDE = 64;
export const BLOCKS = 16;
const SPAN = SIDE / BLOCKS;

/**
 * Of a volume, uint8 [64, 64, 64] as [x][y][z]: {room, low, high, empty}. `room` is uint8 [16, 16, 16], how many blocks
 * away (in the largest coordinate) the nearest one is that any interpolated value above one half can lie in, 0 for such
 * a block itself; `low` and `high` bound those blocks in world units.
 */
export function survey(volume) {
  const occupied = new Uint8Array(BLOCKS ** 3);
  const least = [BLOCKS, BLOCKS, BLOCKS];
  const most = [-1, -1, -1];
  // A voxel above one half reaches half a voxel into the next block, where it lies at a block's side.
  const reach = (i) => [Math.max(0, ((i - 1) / SPAN) | 0), Math.min(BLOCKS - 1, ((i + 1) / SPAN) | 0)];
  let index = 0;
  for (let x = 0; x < SIDE; x++) {
    for (let y = 0; y < SIDE; y++) {
      for (let z = 0; z < SIDE; z++) {
        if (volume[index++] < 128) continue;
        const [x0, x1] = reach(x);
        const [y0, y1] = reach(y);
        const [z0, z1] = reach(z);
        for (let i = x0; i <= x1; i++)
          for (let j = y0; j <= y1; j++) for (let k = z0; k <= z1; k++) occupied[(i * BLOCKS + j) * BLOCKS + k] = 1;
      }
    }
  }
  const room = new Uint8Array(BLOCKS ** 3).fill(BLOCKS);
  let empty = true;
  for (let i = 0; i < BLOCKS; i++)
    for (let j = 0; j < BLOCKS; j++)
      for (let k = 0; k < BLOCKS; k++) {
        if (!occupied[(i * BLOCKS + j) * BLOCKS + k]) continue;
        empty = false;
        [i, j, k].forEach((at, axis) => {
          least[axis] = Math.min(least[axis], at);
          most[axis] = Math.max(most[axis], at);
        });
        room[(i * BLOCKS + j) * BLOCKS + k] = 0;
      }
  spread(room);
  const world = (block) => block / BLOCKS - 0.5;
  return {
    room,
    empty,
    low: empty ? [0, 0, 0] : least.map(world),
    high: empty ? [0, 0, 0] : most.map((at) => world(at + 1)),
  };
}

// The distance in the largest coordinate, by one sweep there and one back over all 26 neighbours.
function spread(room) {
  const behind = [];
  for (let i = -1; i <= 1; i++)
    for (let j = -1; j <= 1; j++)
      for (let k = -1; k <= 1; k++) if (i < 0 || (i === 0 && (j < 0 || (j === 0 && k < 0)))) behind.push([i, j, k]);
  const inside = (at) => at >= 0 && at < BLOCKS;
  const sweep = (sign) => {
    for (let step = 0; step < BLOCKS ** 3; step++) {
      const index = sign > 0 ? step : BLOCKS ** 3 - 1 - step;
      const i = (index / BLOCKS / BLOCKS) | 0;
      const j = ((index / BLOCKS) | 0) % BLOCKS;
      const k = index % BLOCKS;
      for (const [a, b, c] of behind) {
        const [x, y, z] = [i + sign * a, j + sign * b, k + sign * c];
        if (!inside(x) || !inside(y) || !inside(z)) continue;
        room[index] = Math.min(room[index], room[(x * BLOCKS + y) * BLOCKS + z] + 1);
      }
    }
  };
  sweep(1);
  sweep(-1);
}

/** uint8 [64, 64] over x and z from -1 to 1: how much of the light from above the solid keeps off the ground. */
export function shadowOf(volume) {
  let map = new Float32Array(SIDE * SIDE);
  for (let x = 0; x < SIDE; x++)
    for (let z = 0; z < SIDE; z++) {
      let height = -1;
      for (let y = 0; y < SIDE && height < 0; y++) if (volume[(x * SIDE + y) * SIDE + z] > 127) height = y;
      // The cube takes up the middle half of the map in both directions; what floats high throws less of a shadow.
      if (height >= 0) map[(16 + (x >> 1)) * SIDE + 16 + (z >> 1)] += 0.25 * Math.exp(-height / 24);
    }
  for (let pass = 0; pass < 3; pass++) map = blur(blur(map, 1, SIDE), SIDE, 1);
  return Uint8Array.from(map, (value) => Math.round(255 * Math.min(1, value)));
}

// A box 5 wide along one axis.
function blur(map, step, row) {
  const out = new Float32Array(map.length);
  for (let line = 0; line < SIDE; line++)
    for (let i = 0; i < SIDE; i++) {
      let sum = 0;
      for (let d = -2; d <= 2; d++) if (i + d >= 0 && i + d < SIDE) sum += map[line * row + (i + d) * step];
      out[line * row + i * step] = sum / 5;
    }
  return out;
}

/** uint8 [64, 64, 64, 2]: a volume, and the same blurred by a binomial of five along each axis. */
export function paired(volume) {
  let soft = Float32Array.from(volume);
  let spare = new Float32Array(soft.length);
  for (const step of [1, SIDE, SIDE * SIDE]) {
    for (let i = 0; i < soft.length; i++) {
      const at = Math.floor(i / step) % SIDE;
      const left = i - step * Math.min(at, 1);
      const right = i + step * Math.min(SIDE - 1 - at, 1);
      const far = soft[i - step * Math.min(at, 2)] + soft[i + step * Math.min(SIDE - 1 - at, 2)];
      spare[i] = (6 * soft[i] + 4 * (soft[left] + soft[right]) + far) / 16;
    }
    [soft, spare] = [spare, soft];
  }
  const pairs = new Uint8Array(2 * volume.length);
  for (let i = 0; i < volume.length; i++) {
    pairs[2 * i] = volume[i];
    pairs[2 * i + 1] = Math.round(soft[i]);
  }
  return pairs;
}
