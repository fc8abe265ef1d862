// A path over the server's grid for its planning robot (nav_msgs/OccupancyGrid): A* over free cells, 8 neighbours.

const unknown = 255;
const inscribed = 99;
const maxVisited = 2_000_000;
/** How much a cell of the highest cost counts, in cells. */
const costWeight = 6;

const neighbours = [[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [1, -1], [-1, 1], [-1, -1]];

/** A heap of cells by their estimated length. */
class Queue {
  #cells = [];
  get size() { return this.#cells.length; }
  push(priority, cell) {
    const heap = this.#cells;
    let i = heap.length;
    heap.push([priority, cell]);
    for (let up = (i - 1) >> 1; i > 0 && heap[up][0] > heap[i][0]; i = up, up = (i - 1) >> 1) {
      [heap[up], heap[i]] = [heap[i], heap[up]];
    }
  }
  pop() {
    const heap = this.#cells;
    const top = heap[0][1];
    const last = heap.pop();
    if (heap.length === 0) return top;
    heap[0] = last;
    for (let i = 0;;) {
      let least = i;
      for (const child of [2 * i + 1, 2 * i + 2]) {
        if (child < heap.length && heap[child][0] < heap[least][0]) least = child;
      }
      if (least === i) return top;
      [heap[least], heap[i]] = [heap[i], heap[least]];
      i = least;
    }
  }
}

/** {path: [[x, y], ...]} in the map frame, or {fault: why there is none}. `from` and `to` are [x, y]. */
export function planOnGrid({ info, data }, from, to) {
  const { width, height, resolution } = info;
  const { x: originX, y: originY } = info.origin.position;
  if (width === 0 || height === 0) return { fault: "the server publishes no grid yet" };
  const costs = new Uint8Array(data.buffer, data.byteOffset, data.length);
  const column = (x) => Math.floor((x - originX) / resolution);
  const row = (y) => Math.floor((y - originY) / resolution);
  const isInside = (cx, cy) => cx >= 0 && cy >= 0 && cx < width && cy < height;
  const isFree = (cell) => costs[cell] !== unknown && costs[cell] < inscribed;
  const cellAt = ([x, y]) => isInside(column(x), row(y)) ? row(y) * width + column(x) : undefined;
  const goal = cellAt(to);
  const start = cellAt(from);
  if (goal === undefined) return { fault: "the goal is outside of the known area" };
  if (start === undefined) return { fault: "the robot is outside of the known area" };
  if (!isFree(goal)) return { fault: costs[goal] === unknown ? "the goal is unknown ground" : "the goal is blocked" };
  const lengths = new Float64Array(width * height).fill(Infinity);
  lengths[start] = 0;
  const before = new Int32Array(width * height).fill(-1);
  const done = new Uint8Array(width * height);
  const left = (cell) => Math.hypot(cell % width - goal % width, Math.floor(cell / width) - Math.floor(goal / width));
  const queue = new Queue();
  queue.push(left(start), start);
  let visited = 0;
  while (queue.size > 0 && visited < maxVisited) {
    const cell = queue.pop();
    if (done[cell]) continue;
    if (cell === goal) return { path: pathTo(goal, before, { width, resolution, originX, originY }) };
    done[cell] = 1;
    ++visited;
    const x = cell % width;
    const y = (cell - x) / width;
    for (const [dx, dy] of neighbours) {
      const next = cell + dy * width + dx;
      if (!isInside(x + dx, y + dy) || done[next] || !isFree(next)) continue;
      const length = lengths[cell] + Math.hypot(dx, dy) * (1 + costWeight * costs[next] / 98);
      if (length >= lengths[next]) continue;
      lengths[next] = length;
      before[next] = cell;
      queue.push(length + left(next), next);
    }
  }
  if (queue.size > 0) {
    return { fault: `no way was found in the ${maxVisited / 1e6} million cells that a browser looks at: set a nearer goal, or ask 'stillmap plan'` };
  }
  return { fault: "no free way leads there" };
}

function pathTo(goal, before, { width, resolution, originX, originY }) {
  const path = [];
  for (let cell = goal; cell >= 0; cell = before[cell]) {
    path.push([originX + (cell % width + 0.5) * resolution, originY + (Math.floor(cell / width) + 0.5) * resolution]);
  }
  return path.reverse();
}
