// What is asked of the server: regions, single places, paths. Requests are those of the services' definitions.
import { blockReasons, className, removalReasons } from "./classes.js";

const [sphere, polygon, corridor] = [1, 2, 3];
const freeState = 1;
const lowest = -1000;
const highest = 1000;
/** Round a place, for what was removed there. */
const removedRadius = 0.75;

const emptyRegion = { kind: 0, min_x: 0, min_y: 0, min_z: lowest, max_x: 0, max_y: 0, max_z: highest, centre_x: 0, centre_y: 0,
  centre_z: 0, radius_m: 0, half_width_m: 0, x: [], y: [] };

export const sphereRegion = ({ x, y, z }, radius) =>
  ({ ...emptyRegion, kind: sphere, centre_x: x, centre_y: y, centre_z: z, radius_m: radius });
export const polygonRegion = (corners) =>
  ({ ...emptyRegion, kind: polygon, x: corners.map(([x]) => x), y: corners.map(([, y]) => y) });
export const corridorRegion = (path, width) =>
  ({ ...emptyRegion, kind: corridor, half_width_m: width / 2, x: path.map(([x]) => x), y: path.map(([, y]) => y) });

function accepted(reply) {
  if (reply.status.code !== 0) throw new Error(reply.status.reason);
  return reply;
}

export class Server {
  constructor(connection, prefix, formatVersion) {
    this.connection = connection;
    this.prefix = prefix;
    this.formatVersion = formatVersion;
  }

  async #ask(service, request) {
    return accepted(await this.connection.call(`${this.prefix}/${service}`, { format_version: this.formatVersion, ...request }));
  }

  /** {total, byClass: [[name, voxels], ...]}, most first; of all pages of one version. */
  async voxelsIn(region, isWanted = () => true) {
    const counts = new Map();
    let total = 0;
    let continuation = "";
    do {
      const reply = await this.#ask("get_static_map", { region, classes: [], resolution_m: 0, max_bytes: 4_000_000,
        since_map_id: 0n, since_version: 0n, continuation });
      for (const label of reply.voxels.label) counts.set(label, (counts.get(label) ?? 0) + 1);
      total = Number(reply.total_voxels);
      continuation = reply.continuation;
    } while (continuation && isWanted());
    return { total, byClass: [...counts].sort((a, b) => b[1] - a[1]).map(([label, n]) => [className(label), n]) };
  }

  /** The voxel nearest to a place: {label, confidence, points}; undefined where there is none. */
  async evidenceAt(position, radius) {
    const { voxels } = await this.#ask("get_static_map", { region: sphereRegion(position, radius), classes: [], resolution_m: 0,
      max_bytes: 100_000, since_map_id: 0n, since_version: 0n, continuation: "" });
    let best;
    for (let i = 0; i < voxels.x.length; ++i) {
      const distance = Math.hypot(voxels.x[i] - position.x, voxels.y[i] - position.y, voxels.z[i] - position.z);
      if (best && distance >= best.distance) continue;
      best = { distance, label: voxels.label[i], confidence: voxels.confidence[i], points: voxels.point_count[i] };
    }
    return best;
  }

  /** [[reason, class, voxels], ...] of what is kept out of the map round a place. */
  async removedAt(position) {
    const reply = await this.#ask("get_removed", { region: sphereRegion(position, removedRadius), reasons: [], max_voxels: 1000 });
    const counts = new Map();
    for (let i = 0; i < reply.label.length; ++i) {
      const key = `${removalReasons[reply.reason[i]]}\n${className(reply.label[i])}`;
      counts.set(key, (counts.get(key) ?? 0) + 1);
    }
    return [...counts].map(([key, n]) => [...key.split("\n"), n]);
  }

  /** The robots whose free space the server keeps. */
  async profiles() {
    const reply = await this.connection.call(`${this.prefix}/get_traversable_area`, this.#area("?", sphereRegion({ x: 0, y: 0, z: 0 }, 1)));
    // It refuses an unknown one with the names of those that it knows.
    const names = reply.status.reason.match(/traversability for: ([^;]+);/)?.[1];
    return names ? names.split(", ") : [];
  }

  /** The planning robot's grid, as nav_msgs/OccupancyGrid; it is published only when it changes. */
  async grid() {
    return (await this.connection.call(`${this.prefix}/get_map`, { structure_needs_at_least_one_member: 0 })).map;
  }

  #area(profile, region) {
    return { format_version: this.formatVersion, profile, region, include_grid: true, include_outlines: false, max_cells: 0,
      min_outline_area_m2: 0 };
  }

  /** {isFree, why} of the cell at a place for a robot. */
  async freeAt(profile, position) {
    const { grid } = accepted(await this.connection.call(`${this.prefix}/get_traversable_area`,
      this.#area(profile, sphereRegion(position, 1))));
    const column = Math.floor((position.x - grid.origin_x) / grid.resolution_m);
    const row = Math.floor((position.y - grid.origin_y) / grid.resolution_m);
    if (column < 0 || row < 0 || column >= grid.width || row >= grid.height) return { isFree: false, why: "unknown" };
    const cell = row * grid.width + column;
    return { isFree: grid.state[cell] === freeState, why: blockReasons[grid.reason[cell]] ?? "" };
  }

  /** Whether a robot can follow a path [[x, y], ...]; else where and why not. */
  async checkPath(profile, path) {
    const reply = await this.#ask("check_path", { profile, x: path.map(([x]) => x), y: path.map(([, y]) => y), heading_rad: [] });
    return { isFree: reply.is_free, clearance: reply.clearance_m, at: [reply.conflict_x, reply.conflict_y],
      why: blockReasons[reply.conflict_reason] ?? "" };
  }
}
