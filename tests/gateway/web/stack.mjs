// Real processes for the tests of gateway and page: server, gateway, replay; Foxglove's own client; a browser.
import { execFileSync, spawn, spawnSync } from "node:child_process";
import { closeSync, existsSync, mkdtempSync, openSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";

const packages = new URL("../../../clients/web/package.json", import.meta.url);
export const require = createRequire(packages);
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader, MessageWriter } = require("@foxglove/rosmsg2-serialization");
const WebSocket = require("ws");

const bin = join(process.env.BUILD ?? "build/release", "bin");
/** A loaded machine needs long; nothing waits longer than it must. */
export const patienceMs = Number(process.env.STILLMAP_PATIENCE_S ?? 120) * 1000;

export const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** The first value of `look` that is true. */
export async function eventually(what, look, timeoutMs = patienceMs) {
  for (const end = Date.now() + timeoutMs; Date.now() < end; await sleep(50)) {
    const found = await look();
    if (found) return found;
  }
  throw new Error(`waited ${timeoutMs} ms for ${what}`);
}

/** A DDS domain that no other test takes while this process runs, as tests/domain_lease.hpp. */
function freeDomain() {
  for (;;) {
    const domain = String(20 + Math.floor(Math.random() * 200));
    const file = openSync(join(tmpdir(), `stillmap-test-domain-${domain}-of-${process.getuid()}`), "a");
    // The lock belongs to the open file, which this process keeps.
    if (spawnSync("flock", ["--nonblock", "3"], { stdio: ["ignore", "ignore", "ignore", file] }).status === 0) return domain;
    closeSync(file);
  }
}

/** A server and a gateway in a domain of their own. `end()` stops everything. */
export class Stack {
  constructor() {
    this.folder = mkdtempSync(join(tmpdir(), "stillmap_web_"));
    this.domain = freeDomain();
    this.children = [];
  }

  spawn(program, ...parameters) {
    const child = spawn(join(bin, program), parameters, { stdio: ["ignore", "pipe", "pipe"] });
    child.text = "";
    for (const stream of [child.stdout, child.stderr]) stream.on("data", (data) => { child.text += data; });
    child.ended = new Promise((resolve) => child.on("exit", resolve));
    this.children.push(child);
    return child;
  }

  /** What the command line prints with --json. */
  ask(...parameters) {
    const text = execFileSync(join(bin, "stillmap"),
      [...parameters, "--domain", this.domain, "--timeout", String(patienceMs / 1000), "--json"], { encoding: "utf8" });
    return JSON.parse(text);
  }

  simulate(scans) {
    const sequence = join(this.folder, "yard");
    if (!existsSync(sequence)) {
      execFileSync(join(bin, "stillmap"), ["simulate", sequence, "--preset", "yard", "--sensor", "vlp_16", "--scans", String(scans)]);
    }
    return sequence;
  }

  startServer(...parameters) {
    this.server = this.spawn("stillmap-server", "--domain", this.domain, ...parameters);
    return this.server;
  }

  async startGateway(...parameters) {
    this.gateway = this.spawn("stillmap-gateway", "--domain", this.domain, "--listen", "127.0.0.1:0",
      "--timeout", String(patienceMs / 1000), ...parameters);
    const port = await eventually("the gateway's address", () => this.gateway.text.match(/wss?:\/\/127\.0\.0\.1:(\d+)/)?.[1]);
    this.port = Number(port);
    return this.port;
  }

  replay(sequence, ...parameters) {
    return this.spawn("stillmap", "replay", sequence, "--domain", this.domain, "--timeout", String(patienceMs / 1000),
      ...parameters);
  }

  async end() {
    for (const child of this.children) {
      child.kill("SIGCONT");
      child.kill("SIGTERM");
    }
    await Promise.all(this.children.map((child) => child.ended));
    rmSync(this.folder, { recursive: true, force: true });
  }
}

/** Foxglove's own client, with its messages decoded. */
export class Client {
  constructor(port, { path = "/", subprotocol = "foxglove.websocket.v1", ...options } = {}) {
    this.socket = new WebSocket(`ws://127.0.0.1:${port}${path}`, [subprotocol], options);
    this.client = new FoxgloveClient({ ws: this.socket });
    this.channels = new Map();
    this.services = new Map();
    this.statuses = [];
    this.replies = new Map();
    this.received = new Map();
    this.nextCall = 1;
    this.client.on("serverInfo", (info) => { this.info = info; });
    this.client.on("advertise", (channels) => channels.forEach((channel) => this.channels.set(channel.topic, channel)));
    this.client.on("advertiseServices", (services) => services.forEach((service) => this.services.set(service.name, service)));
    this.client.on("status", (status) => this.statuses.push(status));
    this.client.on("message", ({ subscriptionId, data }) => this.received.get(subscriptionId)?.(data));
    this.client.on("serviceCallResponse", (reply) => this.replies.get(reply.callId)?.resolve(reply.data));
    this.client.on("serviceCallFailure", ({ callId, message }) => this.replies.get(callId)?.reject(new Error(message)));
    this.client.on("error", (error) => { this.error = error; });
    this.client.on("close", (event) => { this.closed = event; });
  }

  ready() { return eventually("the list of services", () => this.services.size > 0); }

  /** `listener(message)` for each message of a topic; `raw` ones are not decoded. */
  listen(topic, listener, { raw = false } = {}) {
    const channel = this.channels.get(topic);
    const reader = raw ? undefined : new MessageReader(parse(channel.schema, { ros2: true }));
    const id = this.client.subscribe(channel.id);
    this.received.set(id, (data) => listener(raw ? data : reader.readMessage(data)));
    return id;
  }

  /** The first message of a topic that is as wanted. */
  first(topic, isWanted = () => true) {
    return new Promise((resolve) => {
      this.listen(topic, (message) => { if (isWanted(message)) resolve(message); });
    });
  }

  async call(name, request) {
    const { id, request: { schema }, response } = this.services.get(name);
    const data = new MessageWriter(parse(schema, { ros2: true })).writeMessage(request);
    const reply = await this.callRaw(id, data);
    return new MessageReader(parse(response.schema, { ros2: true })).readMessage(
      new DataView(reply.buffer, reply.byteOffset, reply.byteLength));
  }

  callRaw(serviceId, data, encoding = "cdr") {
    const callId = this.nextCall++;
    this.client.sendServiceCallRequest({ serviceId, callId, encoding, data });
    return new Promise((resolve, reject) => this.replies.set(callId, { resolve, reject }));
  }

  publish(topic, schemaName, schema, message) {
    const id = this.client.advertise({ topic, encoding: "cdr", schemaName });
    this.client.sendMessage(id, new MessageWriter(parse(schema, { ros2: true })).writeMessage(message));
  }

  close() { this.socket.terminate(); }
}
