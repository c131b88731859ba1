// Programs of the picture: particles, obstacles, floor and lines write colour, normal and depth; a last pass lights them
// (shadow map, eye-dome lighting: Boucheny 2009) and averages the samples of a pixel.

/** What all that draw particles share: their place at a time between two frames. */
const particlePlace = `
layout(location=0) in vec3 now; layout(location=1) in vec3 next; layout(location=2) in float type;
uniform vec3 nowLow, nowStep, nextLow, nextStep, period; uniform float blend; uniform vec4 slice;
vec3 unwrapped(vec3 d) { return d - period * floor(mix(vec3(0.0), d / max(period, 1e-30) + 0.5, step(1e-20, period))); }
bool gone(vec3 q) { return q.x > 65534.5; }
vec3 way() { return gone(next) ? vec3(0.0) : unwrapped(nextLow + nextStep * next - nowLow - nowStep * now); }
vec3 place() { return nowLow + nowStep * now + blend * way(); }
bool hidden(vec3 x) { return gone(now) || dot(slice.xyz, x) > slice.w; }`;

export const particleVertex = `#version 300 es
precision highp float;
${particlePlace}
layout(location=3) in vec3 other; layout(location=4) in vec3 otherNext;
uniform vec3 otherLow, otherStep, otherNextLow, otherNextStep; uniform float otherBlend;
uniform mat4 view, projection; uniform float radius, pixels, perSecond, scale; uniform int coloring;
uniform sampler2D palette, colors;
out vec3 tint; out vec3 middle;
vec3 otherPlace() {
  vec3 x = otherLow + otherStep * other;
  return gone(otherNext) ? x : x + otherBlend * unwrapped(otherNextLow + otherNextStep * otherNext - x);
}
void main() {
  vec3 x = place();
  vec4 p = view * vec4(x, 1.0);
  middle = p.xyz;
  gl_Position = hidden(x) ? vec4(2.0, 2.0, 2.0, 1.0) : projection * p;
  gl_PointSize = max(1.0, pixels * radius / max(1e-6, -p.z));
  if (coloring == 0) {
    tint = texture(palette, vec2((type + 0.5) / 256.0, 0.5)).rgb;
  } else {
    float value = coloring == 1 ? length(way()) * perSecond : gone(other) ? 0.0 : length(unwrapped(x - otherPlace()));
    tint = texture(colors, vec2((clamp(value / scale, 0.0, 1.0) * 255.0 + 0.5) / 256.0, 0.5)).rgb;
  }
}`;
export const particleFragment = `#version 300 es
precision highp float;
in vec3 tint; in vec3 middle;
uniform mat4 projection; uniform float radius;
layout(location=0) out vec4 color; layout(location=1) out vec4 normal;
void main() {
  vec2 q = 2.0 * gl_PointCoord - 1.0; q.y = -q.y;
  float r2 = dot(q, q);
  if (r2 > 1.0) discard;
  vec3 n = vec3(q, sqrt(1.0 - r2));
  vec4 p = projection * vec4(middle + radius * n, 1.0);
  gl_FragDepth = clamp(0.5 * p.z / p.w + 0.5, 0.0, 1.0);
  color = vec4(tint, 1.0);
  normal = vec4(0.5 * n + 0.5, 1.0);
}`;

/** Seen from the light; parallel rays. */
export const particleShadowVertex = `#version 300 es
precision highp float;
${particlePlace}
uniform mat4 light; uniform float pixels;
void main() {
  vec3 x = place();
  gl_Position = hidden(x) ? vec4(2.0, 2.0, 2.0, 1.0) : light * vec4(x, 1.0);
  gl_PointSize = pixels;
}`;
export const particleShadowFragment = `#version 300 es
precision highp float;
void main() { vec2 q = 2.0 * gl_PointCoord - 1.0; if (dot(q, q) > 1.0) discard; }`;

const poseOf = `uniform mat3 rotation; uniform vec3 translation;`;
export const meshVertex = `#version 300 es
precision highp float;
layout(location=0) in vec3 corner; layout(location=1) in vec3 direction;
${poseOf} uniform mat4 view, projection;
out vec3 world; out vec3 side;
void main() {
  world = rotation * corner + translation;
  side = mat3(view) * (rotation * direction);
  gl_Position = projection * view * vec4(world, 1.0);
}`;
/** Where a slice cuts a body its inside is seen, in one colour as if it were filled. */
export const meshFragment = `#version 300 es
precision highp float;
in vec3 world; in vec3 side;
uniform vec4 slice; uniform vec3 tint; uniform mat4 view;
layout(location=0) out vec4 color; layout(location=1) out vec4 normal;
void main() {
  if (dot(slice.xyz, world) > slice.w) discard;
  bool cut = !gl_FrontFacing && dot(slice.xyz, slice.xyz) > 0.5;
  vec3 n = cut ? mat3(view) * slice.xyz : normalize(gl_FrontFacing ? side : -side);
  color = vec4(cut ? 0.72 * tint : tint, 1.0);
  normal = vec4(0.5 * n + 0.5, 1.0);
}`;
export const meshShadowVertex = `#version 300 es
precision highp float;
layout(location=0) in vec3 corner; ${poseOf} uniform mat4 light; out vec3 world;
void main() { world = rotation * corner + translation; gl_Position = light * vec4(world, 1.0); }`;
export const meshShadowFragment = `#version 300 es
precision highp float;
in vec3 world; uniform vec4 slice;
void main() { if (dot(slice.xyz, world) > slice.w) discard; }`;

export const floorVertex = `#version 300 es
precision highp float;
layout(location=0) in vec3 corner; uniform mat4 view, projection; out vec3 world;
void main() { world = corner; gl_Position = projection * view * vec4(corner, 1.0); }`;
export const floorFragment = `#version 300 es
precision highp float;
in vec3 world; uniform vec3 low, up; uniform float check; uniform mat4 view;
layout(location=0) out vec4 color; layout(location=1) out vec4 normal;
void main() {
  vec3 cell = floor((world - low) / check + 1e-4) * (1.0 - abs(up));
  float odd = mod(cell.x + cell.y + cell.z, 2.0);
  color = vec4(mix(vec3(0.33, 0.345, 0.37), vec3(0.375, 0.39, 0.415), odd), 1.0);
  normal = vec4(0.5 * mat3(view) * up + 0.5, 1.0);
}`;
export const lineVertex = `#version 300 es
precision highp float;
layout(location=0) in vec3 corner; uniform mat4 view, projection;
void main() { gl_Position = projection * view * vec4(corner, 1.0); }`;
export const lineFragment = `#version 300 es
precision highp float;
layout(location=0) out vec4 color; layout(location=1) out vec4 normal;
void main() { color = vec4(0.46, 0.49, 0.54, 1.0); normal = vec4(0.0); }`;

export const screenVertex = `#version 300 es
out vec2 at;
void main() { at = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0; gl_Position = vec4(2.0 * at - 1.0, 0.0, 1.0); }`;
export const lightFragment = `#version 300 es
precision highp float;
precision highp sampler2DShadow;
in vec2 at; out vec4 shown;
uniform sampler2D colorOf, normalOf, depthOf; uniform sampler2DShadow shadowOf;
uniform ivec2 origin, size; uniform int samples; uniform bool shadows;
uniform vec3 eye, side, top, back, towards; uniform mat4 light;
uniform vec2 slope; uniform float near, far, bias, softness;

float distanceAt(ivec2 p) {
  float z = texelFetch(depthOf, clamp(p, origin, origin + size - 1), 0).r;
  return z >= 1.0 ? far : 2.0 * near * far / (far + near - (2.0 * z - 1.0) * (far - near));
}
float eyeDome(ivec2 p, float own) {
  float sum = 0.0, logOwn = log2(own);
  for (int k = 0; k < 8; ++k) {
    float angle = 0.7853982 * float(k);
    ivec2 step = ivec2(round(vec2(cos(angle), sin(angle)) * 1.6 * float(samples)));
    sum += clamp(logOwn - log2(distanceAt(p + step)), 0.0, 0.02);
  }
  return exp(-9.0 * sum);
}
float lit(vec3 world) {
  if (!shadows) return 1.0;
  vec3 p = (light * vec4(world + bias * towards, 1.0)).xyz * 0.5 + 0.5;
  float sum = 0.0;
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j) sum += texture(shadowOf, p + vec3(vec2(i, j) * softness, 0.0));
  return sum / 9.0;
}
vec3 background(float y) { return mix(vec3(0.085, 0.092, 0.105), vec3(0.165, 0.178, 0.2), y); }
vec3 shade(ivec2 p) {
  float own = distanceAt(p);
  vec2 place = (vec2(p - origin) + 0.5) / vec2(size);
  if (own >= 0.9999 * far) return background(place.y);
  vec4 color = texelFetch(colorOf, p, 0), packed = texelFetch(normalOf, p, 0);
  if (packed.a < 0.5) return color.rgb;
  vec3 n = normalize(2.0 * packed.rgb - 1.0);
  vec3 normal = side * n.x + top * n.y + back * n.z;
  vec3 ray = side * (2.0 * place.x - 1.0) * slope.x + top * (2.0 * place.y - 1.0) * slope.y - back;
  vec3 world = eye + ray * own;
  float sun = max(0.0, dot(normal, towards)) * lit(world);
  float sky = 0.5 + 0.5 * dot(normal, normalize(back + 0.6 * towards));
  return color.rgb * (0.34 * sky + 0.74 * sun + 0.08) * eyeDome(p, own);
}
void main() {
  vec3 sum = vec3(0.0);
  ivec2 first = origin + ivec2(at * vec2(size) / float(samples)) * samples;
  for (int j = 0; j < samples; ++j)
    for (int i = 0; i < samples; ++i) sum += shade(first + ivec2(i, j));
  shown = vec4(sum / float(samples * samples), 1.0);
}`;
