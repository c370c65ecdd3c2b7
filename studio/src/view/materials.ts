// Materials of the view: one for everything with a surface, light by the eye, colours by what is measured.
import { Color, DoubleSide, ShaderMaterial, Vector4 } from 'three';

export const MODES = { clay: 0, patches: 1, deviation: 2, curvature: 2, zebra: 3 } as const;

const VERTEX = /* glsl */ `
attribute float value;
attribute float patchOf;
attribute float hide;
varying float vHide;
varying vec3 vNormal;
varying vec3 vEye;
varying vec3 vPlace;
varying float vValue;
varying float vPatch;
void main() {
  vec4 eye = modelViewMatrix * vec4(position, 1.0);
  vNormal = normalMatrix * normal;
  vEye = eye.xyz;
  vPlace = position;
  vValue = value;
  vPatch = patchOf;
  vHide = hide;
  gl_Position = projectionMatrix * eye;
}`;

const FRAGMENT = /* glsl */ `
uniform int mode;
uniform vec3 clay;
uniform vec3 back;
uniform float most;
uniform float hovered;
uniform float chosen;
uniform float alone;
uniform vec4 cut;
uniform bool parallel;
varying vec3 vNormal;
varying vec3 vEye;
varying vec3 vPlace;
varying float vValue;
varying float vPatch;
varying float vHide;

// From blue over white to red: even steps of lightness on both sides.
vec3 scale(float x) {
  float t = clamp(abs(x), 0.0, 1.0);
  vec3 far = x < 0.0 ? vec3(0.09, 0.28, 0.62) : vec3(0.69, 0.11, 0.10);
  vec3 mid = x < 0.0 ? vec3(0.40, 0.66, 0.88) : vec3(0.96, 0.60, 0.42);
  vec3 near = vec3(0.94, 0.94, 0.92);
  return t < 0.5 ? mix(near, mid, 2.0 * t) : mix(mid, far, 2.0 * t - 1.0);
}

vec3 palette(float n) {
  vec3 c = 0.5 + 0.5 * cos(6.28318 * (n * 0.618034 + vec3(0.0, 0.33, 0.67)));
  return mix(vec3(0.74), c, 0.42);
}

void main() {
  if (dot(cut.xyz, vPlace) > cut.w || vHide > 0.5) discard;
  bool isPatch = alone >= 0.0;
  if (isPatch && abs(vPatch - alone) > 0.5) discard;
  vec3 toEye = parallel ? vec3(0.0, 0.0, 1.0) : normalize(-vEye);
  vec3 n = normalize(vNormal);
  bool inside = dot(n, toEye) < 0.0;
  if (inside) n = -n;
  vec3 base = clay;
  if (mode == 1) base = palette(floor(vPatch + 0.5));
  if (mode == 2) base = scale(vValue / most);
  if (inside) base = mode == 2 ? mix(base, back, 0.35) : back;
  // A wide key light over the left shoulder, a cool fill from the right, and a rim.
  float key = max(0.0, dot(n, normalize(vec3(-0.45, 0.65, 0.75))));
  float fill = max(0.0, dot(n, normalize(vec3(0.8, -0.15, 0.4))));
  float rim = pow(1.0 - max(0.0, dot(n, toEye)), 3.0);
  float sheen = pow(max(0.0, dot(n, normalize(normalize(vec3(-0.45, 0.65, 0.75)) + toEye))), 40.0);
  vec3 color = base * (0.44 + 0.52 * key + 0.18 * fill * vec3(0.85, 0.93, 1.0)) + 0.07 * rim + 0.10 * sheen;
  if (mode == 2) color = base * (0.62 + 0.40 * key);
  if (mode == 3) {
    vec3 r = reflect(-toEye, n);
    float band = sin(26.0 * r.y);
    float edge = fwidth(26.0 * r.y);
    float stripe = smoothstep(-edge, edge, band);
    color = mix(vec3(0.07, 0.08, 0.10), vec3(0.95), stripe) * (0.80 + 0.20 * key);
  }
  if (hovered >= 0.0 && abs(vPatch - hovered) < 0.5) color = mix(color, vec3(0.30, 0.72, 0.68), 0.22);
  if (chosen >= 0.0 && abs(vPatch - chosen) < 0.5) color = mix(color, vec3(0.98, 0.62, 0.12), 0.36);
  gl_FragColor = vec4(color, 1.0);
}`;

/** Nothing is cut off. */
const WHOLE = new Vector4(0, 0, 0, 1);

export function surfaceMaterial(): ShaderMaterial {
  return new ShaderMaterial({
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    side: DoubleSide,
    // Lines lie on the surface and are seen.
    polygonOffset: true,
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 4,
    uniforms: {
      mode: { value: 0 },
      clay: { value: new Color('#c9c5bc') },
      back: { value: new Color('#7a6a5c') },
      most: { value: 1 },
      hovered: { value: -1 },
      chosen: { value: -1 },
      alone: { value: -1 },
      cut: { value: WHOLE.clone() },
      parallel: { value: false },
    },
  });
}

const DOT_VERTEX = /* glsl */ `
uniform float size;
uniform vec4 cut;
attribute vec3 color;
varying vec3 vColor;
varying float vCut;
void main() {
  vColor = color;
  vCut = dot(cut.xyz, position) - cut.w;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  gl_Position.z -= 0.002 * gl_Position.w;
  gl_PointSize = size;
}`;

const DOT_FRAGMENT = /* glsl */ `
uniform vec3 rim;
varying vec3 vColor;
varying float vCut;
void main() {
  if (vCut > 0.0) discard;
  float r = length(gl_PointCoord - 0.5);
  if (r > 0.5) discard;
  gl_FragColor = vec4(r > 0.32 ? rim : vColor, 1.0);
}`;

/** Discs of a size in pixels. */
export function dotMaterial(size: number, rim: string): ShaderMaterial {
  return new ShaderMaterial({
    vertexShader: DOT_VERTEX,
    fragmentShader: DOT_FRAGMENT,
    uniforms: { size: { value: size }, rim: { value: new Color(rim) }, cut: { value: WHOLE.clone() } },
  });
}

const CLOUD_VERTEX = /* glsl */ `
uniform float size;
uniform vec4 cut;
attribute vec3 color;
varying float vCut;
varying vec3 vTint;
void main() {
  vTint = color;
  vCut = dot(cut.xyz, position) - cut.w;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  gl_PointSize = size;
}`;

const CLOUD_FRAGMENT = /* glsl */ `
varying float vCut;
varying vec3 vTint;
void main() {
  if (vCut > 0.0) discard;
  gl_FragColor = vec4(vTint, 1.0);
}`;

/** Points of a scan, each of its colour. */
export function cloudMaterial(): ShaderMaterial {
  return new ShaderMaterial({
    vertexShader: CLOUD_VERTEX,
    fragmentShader: CLOUD_FRAGMENT,
    uniforms: { size: { value: 2 }, cut: { value: WHOLE.clone() } },
  });
}
