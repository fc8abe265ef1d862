// The static map: which tiles there are, their voxels by content hash over HTTP, and how many of them to draw.
import { BufferGeometry, Group, InterleavedBuffer, InterleavedBufferAttribute, Points, Sphere, Vector3 } from "three";
import { tileMaterial } from "./tile_material.js";

const headBytes = 32;
const bytesPerVoxel = 8;
const stepsPerVoxel = 8;
const fetchesAtOnce = 6;
/** Between two fetches of one tile: those round the robot change with every scan. */
const refetchMs = 1000;
const retryMs = 3000;
const everywhere = 1e6;

/** Of a tile as clients/gateway/tile_format.hpp has it. Throws for anything else. */
export function decodeTile(buffer) {
  const view = new DataView(buffer);
  if (buffer.byteLength < headBytes || view.getUint32(0, true) !== 0x314c5453) throw new Error("no tile");
  const tile = { x: view.getInt32(4, true), y: view.getInt32(8, true), count: view.getUint32(12, true),
    tileSize: view.getFloat32(16, true), voxelSize: view.getFloat32(20, true), minZ: view.getFloat32(24, true) };
  if (buffer.byteLength !== headBytes + bytesPerVoxel * tile.count) throw new Error("a tile ends too early");
  tile.values = new Uint16Array(buffer, headBytes);
  return tile;
}

const keyOf = (info) => `${info.tile_x}/${info.tile_y}`;

export class MapTiles {
  /** `changed()` when something is to be drawn anew; `failed(text)` when what was asked for does not come; without a text, when it comes again. */
  constructor(connection, prefix, formatVersion, changed, failed) {
    this.group = new Group();
    this.material = tileMaterial();
    this.connection = connection;
    this.prefix = prefix;
    this.formatVersion = formatVersion;
    this.changed = changed;
    this.failed = failed;
    this.tiles = new Map();
    this.mapId = undefined;
    this.fetching = 0;
    this.near = new Vector3();
    this.voxels = 0;
    this.bytes = 0;
    this.drawn = 0;
    connection.listen(`${prefix}/tile_index`, (info) => {
      // Another map begins, as after a reset; or it is an entry of one that has ended.
      if (info.identity.map_id !== this.mapId) this.#listSoon();
      else this.#entry(info);
    });
    // The index has no entry of a map without tiles.
    connection.listen(`${prefix}/status`, (status) => {
      if (this.mapId !== undefined && status.map_id !== this.mapId) this.#listSoon();
    });
  }

  #tell(fault) {
    if (fault !== this.fault) this.failed(fault);
    this.fault = fault;
  }

  #listSoon() {
    if (this.listing) return;
    this.listing = setTimeout(async () => {
      try {
        await this.list();
        this.listing = undefined;
        this.#tell(undefined);
      } catch (error) {
        this.#tell(`the new map cannot be listed: ${error.message}`);
        this.listing = undefined;
        // Another entry may be long in coming, where the map does not change.
        if (this.connection.isOpen) this.#listSoon();
      }
    }, refetchMs);
  }

  /** Asks which tiles the whole map has: the topic has only those round the robot. Tiles that it no longer has go. */
  async list() {
    while (!await this.#listOnce());
  }

  /** False where another map began meanwhile. */
  async #listOnce() {
    const mapBefore = this.mapId;
    const unlisted = new Map([...this.tiles.values()].map((tile) => [tile.key, tile.revision]));
    let listed;
    let continuation = "";
    do {
      const reply = await this.connection.call(`${this.prefix}/get_tile_versions`, { format_version: this.formatVersion,
        min_x: -everywhere, min_y: -everywhere, max_x: everywhere, max_y: everywhere, continuation });
      if (reply.status.code !== 0) throw new Error(reply.status.reason);
      listed ??= reply.identity.map_id;
      if (reply.identity.map_id !== listed) return false;
      if (this.mapId !== listed) {
        for (const key of [...this.tiles.keys()]) this.#remove(key);
        this.mapId = listed;
      }
      for (const info of reply.tiles) {
        unlisted.delete(keyOf(info));
        this.#entry(info);
      }
      continuation = reply.continuation;
    } while (continuation);
    // Of another map they went before.
    if (mapBefore !== listed || this.mapId !== listed) return true;
    for (const [key, revision] of unlisted) {
      // What the topic said meanwhile is newer.
      if (this.tiles.get(key)?.revision === revision) this.#remove(key);
    }
    return true;
  }

  get pending() { return [...this.tiles.values()].filter((tile) => tile.wanted !== tile.shown).length; }

  #entry(info) {
    const key = keyOf(info);
    const known = this.tiles.get(key);
    if (known && known.revision > info.state.revision) return;
    if (info.state.voxel_count === 0) { this.#remove(key); return; }
    const tile = known ?? { key, shown: undefined, nextFetch: 0, points: undefined };
    tile.revision = info.state.revision;
    tile.wanted = info.state.content_hash.toString(16);
    tile.centre = new Vector3((info.state.min_x + info.state.max_x) / 2, (info.state.min_y + info.state.max_y) / 2,
      (info.state.min_z + info.state.max_z) / 2);
    this.tiles.set(key, tile);
    this.#fetchNext();
  }

  #remove(key) {
    const tile = this.tiles.get(key);
    if (!tile) return;
    this.#drop(tile);
    this.tiles.delete(key);
    this.changed();
  }

  #drop(tile) {
    if (!tile.points) return;
    this.voxels -= tile.points.userData.count;
    this.group.remove(tile.points);
    tile.points.geometry.dispose();
    tile.points = undefined;
  }

  /** Those nearest to the middle first. */
  #fetchNext() {
    if (this.fetching >= fetchesAtOnce || this.scheduled) return;
    this.scheduled = true;
    // Once for all entries of a message.
    queueMicrotask(() => {
      this.scheduled = false;
      const now = performance.now();
      let tile;
      while (this.fetching < fetchesAtOnce && (tile = this.#nearestDue(now))) this.#fetch(tile);
      if (this.isOneNotDue && !this.timer) {
        this.timer = setTimeout(() => { this.timer = undefined; this.#fetchNext(); }, refetchMs / 4);
      }
    });
  }

  #nearestDue(now) {
    let best;
    let bestDistance = Infinity;
    this.isOneNotDue = false;
    for (const tile of this.tiles.values()) {
      if (tile.isFetching || tile.wanted === tile.shown) continue;
      if (tile.nextFetch > now) { this.isOneNotDue = true; continue; }
      const distance = tile.centre.distanceToSquared(this.near);
      if (distance >= bestDistance) continue;
      best = tile;
      bestDistance = distance;
    }
    return best;
  }

  async #fetch(tile) {
    const wanted = tile.wanted;
    ++this.fetching;
    tile.isFetching = true;
    tile.nextFetch = performance.now() + refetchMs;
    try {
      // With the token, since the cookie may be that of another gateway of this host.
      const response = await fetch(`tiles/${tile.key}/${wanted}${location.search}`, { credentials: "same-origin" });
      if (!response.ok && response.status !== 404) throw new Error(`status ${response.status}`);
      if (response.ok) {
        const buffer = await response.arrayBuffer();
        this.bytes += buffer.byteLength;
        if (this.tiles.get(tile.key) === tile) this.#show(tile, decodeTile(buffer));
      }
      tile.shown = wanted;
      this.#tell(undefined);
    } catch (error) {
      this.#tell(`tiles do not come: ${error.message}`);
      tile.nextFetch = performance.now() + retryMs;
    } finally {
      tile.isFetching = false;
      --this.fetching;
      this.#fetchNext();
    }
  }

  #show(tile, { x, y, count, tileSize, voxelSize, minZ, values }) {
    this.#drop(tile);
    const geometry = new BufferGeometry();
    const buffer = new InterleavedBuffer(values, 4);
    geometry.setAttribute("position", new InterleavedBufferAttribute(buffer, 3, 0));
    geometry.setAttribute("label", new InterleavedBufferAttribute(buffer, 1, 3));
    let top = 0;
    for (let i = 2; i < values.length; i += 4) top = Math.max(top, values[i]);
    const side = tileSize / voxelSize * stepsPerVoxel;
    geometry.boundingSphere = new Sphere(new Vector3(side / 2, side / 2, top / 2), Math.hypot(side, side, top) / 2);
    const points = new Points(geometry, this.material);
    points.position.set(x * tileSize, y * tileSize, minZ);
    points.scale.setScalar(voxelSize / stepsPerVoxel);
    points.updateMatrixWorld();
    points.matrixAutoUpdate = false;
    points.userData = { count, spread: 1, centre: tile.centre, radius: geometry.boundingSphere.radius * voxelSize / stepsPerVoxel };
    points.onBeforeRender = () => {
      this.material.uniforms.spread.value = points.userData.spread;
      this.material.uniformsNeedUpdate = true;
    };
    this.material.uniforms.voxelSize.value = voxelSize;
    tile.points = points;
    this.voxels += count;
    this.group.add(points);
    this.changed();
  }

  /**
   * Chooses how many voxels of each tile are drawn, at most some `budget` of those in sight: all where one covers a
   * pixel or more, fewer farther away, larger ones then. `pixelsPerMetre` is at a distance of 1 m.
   */
  chooseDetail(camera, frustum, pixelsPerMetre, budget) {
    const inSight = [];
    let wanted = 0;
    const voxelSize = this.material.uniforms.voxelSize.value;
    const sphere = new Sphere();
    for (const points of this.group.children) {
      const { centre, radius, count } = points.userData;
      points.visible = frustum.intersectsSphere(sphere.set(centre, radius));
      if (!points.visible) continue;
      const distance = Math.max(centre.distanceTo(camera.position) - radius, 1);
      const pixels = pixelsPerMetre * voxelSize / distance;
      const share = Math.min(1, pixels * pixels);
      inSight.push({ points, share });
      wanted += share * count;
    }
    const scale = Math.min(1, budget / Math.max(wanted, 1));
    this.drawn = 0;
    for (const { points, share } of inSight) {
      const drawn = Math.max(1, Math.round(points.userData.count * share * scale));
      points.geometry.setDrawRange(0, drawn);
      points.userData.spread = Math.min(8, Math.sqrt(points.userData.count / drawn));
      this.drawn += drawn;
    }
  }

  /** The voxel nearest to the eye within `tolerance` [rad] of a ray; undefined where there is none. */
  pick(ray, tolerance) {
    let best;
    const p = new Vector3();
    const sphere = new Sphere();
    for (const points of this.group.children) {
      const { centre, radius, count } = points.userData;
      if (!ray.intersectsSphere(sphere.set(centre, radius + 1))) continue;
      const values = points.geometry.getAttribute("position").data.array;
      const { x, y, z } = points.position;
      const scale = points.scale.x;
      for (let i = 0; i < 4 * count; i += 4) {
        p.set(x + scale * values[i], y + scale * values[i + 1], z + scale * values[i + 2]).sub(ray.origin);
        const along = p.dot(ray.direction);
        if (along <= 0 || (best && along >= best.along)) continue;
        const aside = Math.sqrt(Math.max(0, p.lengthSq() - along * along));
        if (aside > Math.max(tolerance * along, scale * stepsPerVoxel * 0.7)) continue;
        best = { along, position: p.clone().add(ray.origin), label: values[i + 3] };
      }
    }
    return best;
  }
}
