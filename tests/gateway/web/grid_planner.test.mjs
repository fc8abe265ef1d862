// The page's planner on grids of its own, without a browser.
import assert from "node:assert/strict";
import test from "node:test";
import { planOnGrid } from "../../../clients/web/src/grid_planner.js";

/** A free grid of 1 m cells at the origin, with these cells blocked. */
function grid(width, height, blocked) {
  const data = new Int8Array(width * height);
  for (const [x, y] of blocked) data[y * width + x] = 100;
  return { info: { width, height, resolution: 1, origin: { position: { x: 0, y: 0 } } }, data };
}
const wall = (x, height) => Array.from({ length: height }, (_, y) => [x, y]);

test("a way leads through the gap in a wall", () => {
  const gapped = grid(60, 60, wall(30, 60).filter(([, y]) => y !== 57));
  const { path } = planOnGrid(gapped, [2.5, 2.5], [57.5, 2.5]);
  assert.deepEqual(path[0], [2.5, 2.5]);
  assert.deepEqual(path.at(-1), [57.5, 2.5]);
  assert.ok(path.some(([x, y]) => x === 30.5 && y === 57.5));
});

test("behind a closed wall there is no way", () => {
  assert.match(planOnGrid(grid(60, 60, wall(30, 60)), [2.5, 2.5], [57.5, 2.5]).fault, /no free way/);
});

test("a search that is given up does not say that there is none", () => {
  const edge = 2200;
  const far = edge - 5;
  const ring = [-2, -1, 0, 1, 2].flatMap((d) => [[far + d, far - 2], [far + d, far + 2], [far - 2, far + d], [far + 2, far + d]]);
  const { fault } = planOnGrid(grid(edge, edge, ring), [2.5, 2.5], [far + 0.5, far + 0.5]);
  assert.match(fault, /2 million cells/);
  assert.match(fault, /nearer goal/);
});
