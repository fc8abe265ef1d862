// The gateway between real processes: Foxglove's own client at one end, a server with a replay at the other.
import assert from "node:assert/strict";
import { createConnection } from "node:net";
import { after, before, describe, it } from "node:test";
import { Client, Stack, eventually, patienceMs, require, sleep } from "./stack.mjs";

const WebSocket = require("ws");
const formatVersion = 8;

/** What a raw connection gets back for these bytes. */
function exchange(port, bytes, { waitMs = 1000 } = {}) {
  return new Promise((resolve) => {
    const socket = createConnection(port, "127.0.0.1", () => socket.write(bytes));
    let text = "";
    const done = () => { socket.destroy(); resolve(text); };
    socket.on("data", (data) => { text += data.toString("latin1"); });
    socket.on("close", done);
    socket.on("error", done);
    setTimeout(done, waitMs);
  });
}

const get = (port, path, headers = {}) =>
  fetch(`http://127.0.0.1:${port}${path}`, { headers });

describe("gateway", () => {
  const stack = new Stack();
  let port;
  before(async () => {
    stack.startServer("--delivery", "every");
    port = await stack.startGateway("--no-page");
    await stack.replay(stack.simulate(20), "--lossless").ended;
  });
  after(() => stack.end());

  for (const subprotocol of ["foxglove.websocket.v1", "foxglove.sdk.v1"]) {
    it(`says what there is, in ${subprotocol}`, async () => {
      const client = new Client(port, { subprotocol });
      await client.ready();
      assert.equal(client.socket.protocol, subprotocol);
      assert.ok(client.info.capabilities.includes("services"));
      for (const topic of ["/stillmap/odometry", "/stillmap/scan", "/stillmap/tiles", "/tf", "/points"]) {
        assert.ok(client.channels.has(topic), topic);
      }
      assert.equal(client.channels.get("/stillmap/scan").schemaName, "sensor_msgs/msg/PointCloud2");
      assert.ok(client.services.has("/stillmap/get_static_map"));
      assert.ok(!client.services.has("/stillmap/reset"), "what changes the map is not offered");
      client.close();
    });
  }

  it("forwards latched topics to who comes late, and to who comes later still", async () => {
    const first = new Client(port);
    await first.ready();
    // The server publishes its path from time to time.
    const path = await first.first("/stillmap/path", ({ poses }) => poses.length === 20);
    assert.equal(path.header.frame_id, "map");
    const second = new Client(port);
    await second.ready();
    assert.deepEqual((await second.first("/stillmap/path")).poses, path.poses);
    first.close();
    second.close();
  });

  it("forwards every tile of a keyed topic", async () => {
    const { tiles } = stack.ask("status");
    const client = new Client(port);
    await client.ready();
    const seen = new Set();
    client.listen("/stillmap/tile_index", ({ tile_x, tile_y }) => seen.add(`${tile_x}/${tile_y}`));
    await eventually("all tiles", () => seen.size === tiles);
    client.close();
  });

  it("calls services, as the command line sees the same", async () => {
    const client = new Client(port);
    await client.ready();
    const { status, server } = await client.call("/stillmap/get_status", { format_version: formatVersion });
    assert.equal(status.code, 0);
    assert.equal(Number(server.voxel_count), stack.ask("status").voxels);
    await assert.rejects(client.callRaw(9999, new Uint8Array(4)), /no such service/);
    const { id } = client.services.get("/stillmap/get_static_map");
    await assert.rejects(client.callRaw(id, new Uint8Array([0, 1, 0, 0, 8])), /GetStaticMap_Request in CDR/);
    await assert.rejects(client.callRaw(id, new Uint8Array(4), "json"), /in cdr/);
    client.close();
  });

  it("gives tiles by their hash, for ever; and never under a hash that they do not have", async () => {
    const client = new Client(port);
    await client.ready();
    const { tiles } = await client.call("/stillmap/get_tile_versions", { format_version: formatVersion, min_x: -1e5, min_y: -1e5,
      max_x: 1e5, max_y: 1e5, continuation: "" });
    let voxels = 0;
    for (const { tile_x, tile_y, state } of tiles) {
      const response = await get(port, `/tiles/${tile_x}/${tile_y}/${state.content_hash.toString(16)}`);
      assert.match(response.headers.get("cache-control"), /immutable/);
      const bytes = await response.arrayBuffer();
      const count = new DataView(bytes).getUint32(12, true);
      assert.equal(bytes.byteLength, 32 + 8 * count);
      assert.equal(count, state.voxel_count);
      voxels += count;
    }
    assert.equal(voxels, stack.ask("status").voxels);
    const other = await get(port, `/tiles/${tiles[0].tile_x}/${tiles[0].tile_y}/1`);
    assert.equal(other.headers.get("cache-control"), "no-store");
    assert.equal((await get(port, "/tiles/9999/9999/1")).status, 404);
    for (const wrong of ["/tiles/", "/tiles/1/2", "/tiles/a/b/c", "/tiles/1/2/3/4", "/tiles/99999999999/1/1", "/tiles/1/2/xyz"]) {
      assert.equal((await get(port, wrong)).status, 400, wrong);
    }
    client.close();
  });

  it("publishes goals and initial poses, and nothing else", async () => {
    const client = new Client(port);
    await client.ready();
    const schema = client.channels.get("/stillmap/path").schema.replace("geometry_msgs/PoseStamped[] poses", "geometry_msgs/Pose pose");
    const pose = { position: { x: 1, y: 2, z: 3 }, orientation: { x: 0, y: 0, z: 0, w: 1 } };
    client.client.advertise({ topic: "/clicked_point", encoding: "cdr", schemaName: "geometry_msgs/PointStamped" });
    client.publish("/goal_pose", "geometry_msgs/msg/PoseStamped", schema, { header: { stamp: { sec: 1, nsec: 2 }, frame_id: "map" }, pose });
    client.publish("/tf", "tf2_msgs/msg/TFMessage", schema, { header: { stamp: { sec: 1, nsec: 2 }, frame_id: "map" }, pose });
    await eventually("a refusal", () => client.statuses.some(({ message }) => /'\/tf' is not published/.test(message)));
    const id = client.client.advertise({ topic: "/initialpose", encoding: "cdr", schemaName: "geometry_msgs/PoseWithCovarianceStamped" });
    client.client.sendMessage(id, new Uint8Array([0, 1, 0, 0, 1, 2]));
    await eventually("a refusal", () => client.statuses.some(({ message }) => /is no geometry_msgs\/msg\/PoseWithCovarianceStamped/.test(message)));
    assert.ok(!client.statuses.some(({ message }) => /(^|for )\/goal_pose/.test(message)));
    assert.ok(!client.statuses.some(({ message }) => /clicked_point/.test(message)), "nothing was published there");
    client.close();
  });

  it("answers nonsense with a reason, and gives up who sends nothing else", async () => {
    const client = new Client(port);
    await client.ready();
    for (const message of ["{", "[]", '{"op":"subscribe","subscriptions":[{"id":1,"channelId":9999}]}', new Uint8Array([77, 1])]) {
      client.socket.send(message);
    }
    await eventually("four reasons", () => client.statuses.length >= 4);
    for (let i = 0; i < 200; ++i) client.socket.send("{");
    await eventually("the end", () => client.closed);
    const other = new Client(port);
    await other.ready();
    other.close();
  });

  it("refuses messages without an end", async () => {
    const client = new Client(port);
    await client.ready();
    client.socket.send(new Uint8Array(2 << 20));
    await eventually("the end", () => client.closed);
    // 1006 where the connection went down before the reason was read.
    assert.ok([1009, 1006].includes(client.closed.code), client.closed.code);
  });

  it("refuses what is no request of it", async () => {
    assert.match(await exchange(port, "GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n"), /^HTTP\/1.1 403/);
    assert.match(await exchange(port, "GET / HTTP/1.1\r\nHost: localhost\r\nOrigin: https://evil.example\r\n\r\n"), /^HTTP\/1.1 403/);
    assert.match(await exchange(port, "POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n"), /^HTTP\/1.1 405/);
    assert.match(await exchange(port, "GET /../../etc/passwd HTTP/1.1\r\nHost: localhost\r\n\r\n"), /^HTTP\/1.1 404/);
    assert.match(await exchange(port, `GET / HTTP/1.1\r\nHost: localhost\r\nX: ${"a".repeat(40000)}\r\n\r\n`), /^HTTP\/1.1 431/);
    assert.match(await exchange(port, "POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n\r\nhello"), /^HTTP\/1.1 413/);
    assert.match(await exchange(port, `POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 400000\r\n\r\n${"a".repeat(400000)}`), /^HTTP\/1.1 413/);
    assert.equal(await exchange(port, Buffer.from("\x16\x03\x01\x00\xa5\x01\x00\x00", "latin1")), "");
    // No subprotocol of ours.
    const error = await new Promise((resolve) => {
      const socket = new WebSocket(`ws://127.0.0.1:${port}/`, ["other.v1"]);
      socket.on("error", resolve);
    });
    assert.match(error.message, /400/);
    const facts = await get(port, "/gateway.json");
    assert.equal(facts.status, 200);
    // The page waits longer for an answer than the gateway does.
    assert.equal((await facts.json()).timeout_ms, patienceMs);
  });

  it("serves others while connections say nothing", async () => {
    // More than it has at a time: the oldest of those that asked for nothing go.
    const silent = Array.from({ length: 300 }, () => createConnection(port, "127.0.0.1").on("error", () => {}));
    const client = new Client(port);
    await client.ready();
    client.close();
    for (const socket of silent) socket.destroy();
  });

  it("forgets clients that vanish, and stops reading for nobody", async () => {
    const clients = Array.from({ length: 5 }, () => new Client(port));
    for (const client of clients) {
      await client.ready();
      client.listen("/stillmap/status", () => {});
    }
    for (const client of clients) client.close();
    await eventually("no clients", async () => (await (await get(port, "/gateway.json")).json()).clients.length === 0);
  });
});

describe("a client that stops", () => {
  const stack = new Stack();
  after(() => stack.end());

  it("gets the newest when it goes on, delays nobody, and is told what it missed", async () => {
    stack.startServer("--delivery", "latest");
    const port = await stack.startGateway("--no-page");
    const sequence = stack.simulate(20);
    const quick = new Client(port);
    const slow = new Client(port);
    await Promise.all([quick.ready(), slow.ready()]);
    let poses = 0;
    let scans = 0;
    let slowScans = 0;
    quick.listen("/stillmap/odometry", () => { ++poses; });
    quick.listen("/points", () => { ++scans; }, { raw: true });
    slow.listen("/points", () => { ++slowScans; }, { raw: true });
    await eventually("a scan", () => {
      stack.running ??= stack.replay(sequence);
      if (stack.running.exitCode !== null) stack.running = undefined;
      return scans > 0 && slowScans > 0;
    });
    slow.socket.pause();
    for (let i = 0; i < 3; ++i) await stack.replay(sequence).ended;
    const state = await (await get(port, "/gateway.json")).json();
    assert.ok(poses > 10 && scans > 10, `${poses} poses, ${scans} scans`);
    // Some hundred KB of scans at most wait for it, besides what the kernel took.
    for (const { waiting_bytes } of state.clients) assert.ok(waiting_bytes < 5e6, `${waiting_bytes} bytes wait`);
    slow.socket.resume();
    await sleep(200);
    slow.close();
    quick.close();
  });
});

describe("a gateway with a token", () => {
  const stack = new Stack();
  after(() => stack.end());

  it("serves who has it", async () => {
    const { writeFileSync } = await import("node:fs");
    writeFileSync(`${stack.folder}/token`, "0123456789abcdef\n");
    const port = await stack.startGateway("--no-page", "--token-file", `${stack.folder}/token`);
    assert.equal((await get(port, "/gateway.json")).status, 401);
    assert.equal((await get(port, "/gateway.json?token=0123456789abcdeX")).status, 401);
    const answer = await get(port, "/gateway.json?token=0123456789abcdef");
    assert.equal(answer.status, 200);
    const cookie = answer.headers.get("set-cookie");
    assert.match(cookie, /HttpOnly/);
    assert.equal((await get(port, "/gateway.json", { cookie: cookie.split(";")[0] })).status, 200);
    const client = new Client(port, { path: "/?token=0123456789abcdef" });
    await client.ready();
    client.close();
    const refused = new Client(port);
    await eventually("a refusal", () => refused.error);
    assert.match(refused.error.message, /401/);
  });
});

describe("options of the gateway", () => {
  const stack = new Stack();
  after(() => stack.end());

  for (const [parameters, text] of [
    [["--listen", "0.0.0.0:0"], /--tls-certificate/],
    [["--listen", "localhost:1"], /is not an IP address/],
    [["--listen", "203.0.113.1:1", "--trust-network"], /cannot be listened on/],
    [["--page", "/nowhere"], /make web/],
    [["--tls-certificate", "/nowhere.pem"], /given together/],
    [["--tls-certificate", "/nowhere.pem", "--tls-key", "/nowhere.key"], /cannot be used/],
    [["--token-file", "/dev/null"], /has no token/],
  ]) {
    it(`refuses ${parameters.join(" ")}`, async () => {
      const page = parameters.includes("--page") ? [] : ["--no-page"];
      const child = stack.spawn("stillmap-gateway", "--domain", stack.domain, ...page, ...parameters);
      assert.equal(await child.ended, 2);
      assert.match(child.text, text);
    });
  }
});
