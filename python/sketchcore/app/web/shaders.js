// The programs of volume.js. Everything is premultiplied by alpha; colours are sRGB as they are seen.

export const SCREEN_VERTEX = `#version 300 es
void main() {
  vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  gl_Position = vec4(corner, 0.0, 1.0);
}`;

// One ray a pixel. The world cube is [-1/2, 1/2]^3; the texture's axes are (z, y, x), as the volume lies in memory.
export const RAY_FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler3D;

uniform sampler3D volume;      // 64^3: probability, and the same blurred a little, for normals
uniform sampler3D unsure;      // 64^3: 0 .. 1
uniform sampler3D room;        // 16^3: blocks to the nearest one that holds surface, / 255; 0 where it does itself
uniform sampler2D shadow;      // 64^2 (z, x): how much of the light from above is kept off the ground
uniform vec3 eye, right, down, forward;
uniform vec2 centre;           // of the drawing area, in pixels of this frame, y down
uniform float half_side;       // of the drawing area, in the same pixels, divided by tan(fov / 2)
uniform float height;          // of this frame, pixels
uniform vec3 low, high;        // box around the surface
uniform float stride;          // world units between two samples
uniform float opacity;         // of the solid
uniform float doubt;           // 0 or 1: colour by uncertainty
uniform float occlusion;       // 0 or 1: darken what is enclosed
uniform float grid;            // opacity of the ground grid
uniform float shade;           // opacity of the shadow on the ground
uniform vec3 clay, alarm, line;
out vec4 colour;

const float BLOCKS = 16.0;
const float CELL = 1.0 / 64.0;

float at(vec3 p) { return texture(volume, p.zyx + 0.5).r; }

float query(vec3 p) { return texture(unsure, p.zyx + 0.5).r; }

float soft(vec3 p) { return texture(volume, p.zyx + 0.5).g; }

vec3 gradient(vec3 p) {
  vec2 d = vec2(CELL, 0.0);
  return vec3(soft(p + d.xyy) - soft(p - d.xyy), soft(p + d.yxy) - soft(p - d.yxy), soft(p + d.yyx) - soft(p - d.yyx));
}

vec4 ground(vec3 ray) {
  float t = (-0.5 - eye.y) / ray.y;
  if (t <= 0.0 || ray.y >= 0.0) return vec4(0.0);
  vec2 p = eye.xz + t * ray.xz;
  float fade = 1.0 - smoothstep(0.55, 1.25, length(p));
  if (fade <= 0.0) return vec4(0.0);
  vec2 cells = p * 8.0;
  vec2 width = fwidth(cells);
  vec2 near = abs(fract(cells - 0.5) - 0.5) / max(width, 1e-5);
  vec2 cover = (1.0 - smoothstep(0.1, 1.0, near)) * (1.0 - smoothstep(0.15, 0.6, width));
  float lines = max(cover.x, cover.y) * grid * fade;
  float dark = shade * texture(shadow, p.yx * 0.5 + 0.5).r;
  return vec4(line * lines, lines) * (1.0 - dark) + vec4(vec3(0.0), dark);
}

void main() {
  vec2 pixel = vec2(gl_FragCoord.x, height - gl_FragCoord.y);
  vec2 image = (pixel - centre) / half_side;
  vec3 ray = forward + image.x * right + image.y * down;
  colour = ground(ray);
  if (opacity <= 0.0) return;

  vec3 inverse = 1.0 / ray;
  vec3 a = (low - eye) * inverse, b = (high - eye) * inverse;
  vec3 nearest = min(a, b), farthest = max(a, b);
  float enter = max(max(max(nearest.x, nearest.y), nearest.z), 0.0);
  float leave = min(min(farthest.x, farthest.y), farthest.z);
  if (enter >= leave) return;

  vec3 from = (eye + 0.5) * BLOCKS, step_ = ray * BLOCKS, over = inverse / BLOCKS;
  float unit = stride / length(ray);
  float t = enter + 1e-4, before = t;
  bool hit = false;
  float most = 0.0, closest = t; // of a ray that misses: the largest value that it meets, and where
  for (int i = 0; i < 256 && t < leave; i++) {
    vec3 block = clamp(floor(from + step_ * t), 0.0, BLOCKS - 1.0);
    float free = floor(texelFetch(room, ivec3(block.zyx), 0).r * 255.0 + 0.5);
    vec3 target = mix(block - max(free - 1.0, 0.0), block + max(free, 1.0), step(0.0, ray));
    vec3 ends = (target - from) * over;
    float end = min(min(min(ends.x, ends.y), ends.z), leave);
    if (free > 0.0) { t = max(end, t) + 1e-4; before = t; continue; }
    end = max(end, t) + 1e-4;
    for (int j = 0; j < 40 && t < end; j++) {
      float value = at(eye + ray * t);
      if (value > 0.5) { hit = true; break; }
      if (value > most) { most = value; closest = t; }
      before = t;
      t += unit;
    }
    if (hit) break;
  }
  // A ray that passes the surface within a pixel covers part of it: soft outlines at one ray a pixel.
  float near = clamp(32.0 * closest / half_side, 0.01, 0.3);
  float cover = hit ? 1.0 : clamp((most - 0.5 + near) / near, 0.0, 1.0);
  if (cover <= 0.0) return;

  bool border = hit && t <= enter + 2e-4;
  if (!hit) t = closest;
  for (int i = 0; i < 4 && hit && !border; i++) {
    float middle = 0.5 * (before + t);
    if (at(eye + ray * middle) > 0.5) t = middle; else before = middle;
  }
  vec3 p = eye + ray * t;
  vec3 toward = -normalize(ray);
  vec3 normal;
  if (border) {
    vec3 face = step(vec3(enter - 1e-5), nearest);
    normal = -sign(ray) * face / max(length(face), 1e-5);
  } else {
    vec3 g = -gradient(p);
    normal = dot(g, g) > 1e-8 ? normalize(g) : toward;
  }
  if (dot(normal, toward) < 0.0) normal = reflect(normal, toward);

  // A key light over the viewer's left shoulder, sky and ground, and a rim that sets the shape off.
  vec3 key = normalize(toward * 0.6 - right * 0.5 - down * 0.7);
  float lit = 0.5 + 0.5 * dot(normal, key);
  float sky = 0.5 + 0.5 * normal.y;
  float light = 0.34 + 0.1 * sky + 0.68 * lit * lit;
  if (occlusion > 0.5) {
    float closed = at(p + normal * 0.035) + at(p + normal * 0.075) + at(p + normal * 0.13);
    light *= 1.0 - 0.16 * closed;
  }
  vec3 base = clay;
  if (doubt > 0.5) {
    // The surface itself lies at one half everywhere: what tells is how far around it the probability stays near that.
    vec3 d = normal * CELL;
    float wide = 0.0;
    for (float k = 1.5; k < 4.0; k += 1.0) wide += query(p + k * d) + query(p - k * d);
    base = mix(base, alarm, smoothstep(0.15, 0.7, wide / 6.0));
  }
  float rim = pow(1.0 - max(dot(normal, toward), 0.0), 4.0);
  vec3 seen = base * light + 0.08 * rim;
  float alpha = opacity * cover;
  colour = vec4(min(seen, 1.0), 1.0) * alpha + colour * (1.0 - alpha);
}`;

// Lines as strips two triangles wide, softened at their sides.
export const LINE_VERTEX = `#version 300 es
in vec2 place;    // clip coordinates
in vec2 side;     // across the line, pixels; half its width
out vec2 across;
void main() { across = side; gl_Position = vec4(place, 0.0, 1.0); }`;

export const LINE_FRAGMENT = `#version 300 es
precision highp float;
in vec2 across;
uniform vec4 ink;
out vec4 colour;
void main() {
  float alpha = ink.a * clamp(across.y + 0.5 - abs(across.x), 0.0, 1.0);
  colour = vec4(ink.rgb * alpha, alpha);
}`;
