// Pinhole cameras as `sketchcore.camera` has them: axes right, down, forward; a square image of 256 x 256 pixels,
// pixel centres at halves. The 13 viewpoints come packed from Python (15 numbers each); all of them look at the origin,
// so an azimuth, an elevation and a distance say where any camera of the page stands.

export const IMAGE = 256;

/** The camera of 15 packed numbers: position, rotation row by row, field of view in degrees, near, far. */
export function unpack(row) {
  return {
    position: row.slice(0, 3),
    right: row.slice(3, 6),
    down: row.slice(6, 9),
    forward: row.slice(9, 12),
    tan: Math.tan((row[12] * Math.PI) / 360),
  };
}

/** A camera that looks at the origin; angles in degrees, azimuth from +x towards +z, as `Camera.orbit` in Python. */
export function orbit({ azimuth, elevation, distance }, tan) {
  const a = (azimuth * Math.PI) / 180;
  const e = (elevation * Math.PI) / 180;
  const out = [Math.cos(e) * Math.cos(a), Math.sin(e), Math.cos(e) * Math.sin(a)];
  const forward = out.map((x) => -x);
  const right = [Math.sin(a), 0, -Math.cos(a)];
  return { position: out.map((x) => x * distance), right, down: cross(forward, right), forward, tan };
}

/** Where a camera stands that looks at the origin: {azimuth, elevation, distance}; straight above, its right tells. */
export function placeOf(camera) {
  const [x, y, z] = camera.position;
  const distance = Math.hypot(x, y, z);
  const elevation = (Math.asin(Math.max(-1, Math.min(1, y / distance))) * 180) / Math.PI;
  const above = Math.hypot(x, z) < 1e-6 * distance;
  const azimuth = above ? Math.atan2(camera.right[0], -camera.right[2]) : Math.atan2(z, x);
  return { azimuth: (azimuth * 180) / Math.PI, elevation, distance };
}

/** Between two places, the short way round; share 0 .. 1. */
export function between(from, to, share) {
  const mix = (a, b) => a + (b - a) * share;
  const turn = ((((to.azimuth - from.azimuth) % 360) + 540) % 360) - 180;
  return {
    azimuth: from.azimuth + turn * share,
    elevation: mix(from.elevation, to.elevation),
    distance: mix(from.distance, to.distance),
  };
}

/** [x, y, depth] of a world point: pixels of the drawing, and the distance along the camera's forward axis. */
export function project(camera, point) {
  const d = point.map((x, i) => x - camera.position[i]);
  const depth = dot(camera.forward, d);
  const scale = IMAGE / 2 / camera.tan / depth;
  return [IMAGE / 2 + dot(camera.right, d) * scale, IMAGE / 2 + dot(camera.down, d) * scale, depth];
}

/** The world point that a pixel shows at a depth along the forward axis. */
export function unproject(camera, [x, y], depth) {
  const u = ((x * 2) / IMAGE - 1) * camera.tan * depth;
  const v = ((y * 2) / IMAGE - 1) * camera.tan * depth;
  return camera.position.map((p, i) => p + camera.right[i] * u + camera.down[i] * v + camera.forward[i] * depth);
}

/**
 * The direction, in pixels and of length 1, of a world direction's image through a pixel: towards its vanishing point.
 * null where the pixel is the vanishing point itself.
 */
export function imageDirection(camera, [x, y], direction) {
  const u = ((x * 2) / IMAGE - 1) * camera.tan;
  const v = ((y * 2) / IMAGE - 1) * camera.tan;
  const along = dot(camera.forward, direction);
  const dx = dot(camera.right, direction) - u * along;
  const dy = dot(camera.down, direction) - v * along;
  const length = Math.hypot(dx, dy);
  return length < 1e-3 ? null : [dx / length, dy / length];
}

/** Of named cameras, the name of the one that looks most nearly the same way. */
export function nearest(camera, cameras) {
  let best = null;
  let most = -Infinity;
  for (const [name, other] of Object.entries(cameras)) {
    // Looking straight down every azimuth looks the same way, so what is right in the image counts as well.
    const likeness = dot(camera.forward, other.forward) + 0.01 * dot(camera.right, other.right);
    if (likeness > most) [best, most] = [name, likeness];
  }
  return best;
}

export function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

export function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}
