// How voxels are drawn: one point each, in the colour of its class, its height or what a robot may do there.
import { Color, DataTexture, GLSL3, NearestFilter, RGBAFormat, RedFormat, ShaderMaterial, UnsignedByteType, Vector2, Vector4 }
  from "three";
import { classes } from "./classes.js";

export const colourModes = ["class", "height", "traversability"];

function paletteTexture() {
  const texels = new Uint8Array(32 * 4);
  classes.forEach(({ colour }, i) => {
    const { r, g, b } = new Color(colour);
    // As they are: the shader writes them to the screen without a conversion.
    const linear = new Color(r, g, b).convertLinearToSRGB();
    texels.set([linear.r * 255, linear.g * 255, linear.b * 255, 255], 4 * i);
  });
  const texture = new DataTexture(texels, 32, 1, RGBAFormat, UnsignedByteType);
  texture.needsUpdate = true;
  return texture;
}

const vertexShader = `
in float label;
uniform float pixelsPerMetre;  // at a distance of 1 m
uniform float voxelSize;
uniform float spread;          // how much larger, where voxels are left out
uniform int mode;
uniform vec2 heights;
uniform sampler2D palette;
uniform sampler2D grid;        // cost of cells: 0 free, 1..99 with a cost, 100 blocked, 255 unknown
uniform vec4 gridFrame;        // origin x, y; cells per metre; 0 without a grid
uniform vec2 gridSize;
out vec3 colour;

vec3 ramp(float t) {
  t = clamp(t, 0.0, 1.0);
  return clamp(vec3(1.5 - abs(4.0 * t - 3.0), 1.5 - abs(4.0 * t - 2.0), 1.5 - abs(4.0 * t - 1.0)), 0.1, 1.0);
}

vec3 costColour(vec2 at) {
  if (gridFrame.w == 0.0) return vec3(0.35);
  vec2 cell = (at - gridFrame.xy) * gridFrame.z;
  if (any(lessThan(cell, vec2(0.0))) || any(greaterThanEqual(cell, gridSize))) return vec3(0.25);
  float cost = texelFetch(grid, ivec2(cell), 0).r * 255.0;
  if (cost > 100.5) return vec3(0.3);
  if (cost > 99.5) return vec3(0.85, 0.2, 0.15);
  if (cost > 98.5) return vec3(0.95, 0.55, 0.15);
  return mix(vec3(0.15, 0.75, 0.3), vec3(0.75, 0.8, 0.2), cost / 98.0);
}

void main() {
  vec4 world = modelMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * viewMatrix * world;
  gl_PointSize = clamp(pixelsPerMetre * voxelSize * spread / gl_Position.w, 1.0, 60.0);
  float shade = 0.75 + 0.25 * clamp((world.z - heights.x) / max(heights.y - heights.x, 0.1), 0.0, 1.0);
  if (mode == 0) colour = texelFetch(palette, ivec2(int(label + 0.5), 0), 0).rgb * shade;
  else if (mode == 1) colour = ramp((world.z - heights.x) / max(heights.y - heights.x, 0.1));
  else colour = costColour(world.xy) * shade;
}`;

const fragmentShader = `
precision mediump float;
in vec3 colour;
out vec4 pixel;
void main() { pixel = vec4(colour, 1.0); }`;

export function tileMaterial() {
  const empty = new DataTexture(new Uint8Array([255]), 1, 1, RedFormat, UnsignedByteType);
  empty.needsUpdate = true;
  return new ShaderMaterial({
    glslVersion: GLSL3, vertexShader, fragmentShader,
    uniforms: { pixelsPerMetre: { value: 500 }, voxelSize: { value: 0.2 }, spread: { value: 1 }, mode: { value: 0 },
      heights: { value: new Vector2(-2, 8) }, palette: { value: paletteTexture() }, grid: { value: empty },
      gridFrame: { value: new Vector4() }, gridSize: { value: new Vector2() } },
  });
}

/** Shows a nav_msgs/OccupancyGrid in the colour mode "traversability", unless it is wider than textures may be. */
export function setGrid(material, { info, data }, maxTextureSize) {
  const { grid, gridFrame, gridSize } = material.uniforms;
  const isShown = Math.min(info.width, info.height) > 0 && Math.max(info.width, info.height) <= maxTextureSize;
  if (!isShown) { gridFrame.value.w = 0; return; }
  const texels = new Uint8Array(data.buffer, data.byteOffset, data.length).slice();
  grid.value.dispose();
  grid.value = new DataTexture(texels, info.width, info.height, RedFormat, UnsignedByteType);
  grid.value.minFilter = NearestFilter;
  grid.value.magFilter = NearestFilter;
  grid.value.unpackAlignment = 1;
  grid.value.needsUpdate = true;
  gridFrame.value.set(info.origin.position.x, info.origin.position.y, 1 / info.resolution, 1);
  gridSize.value.set(info.width, info.height);
}
