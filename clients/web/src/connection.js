// A client of the Foxglove protocol: topics and services of the gateway, decoded.
import { FoxgloveClient } from "@foxglove/ws-protocol";
import { parse } from "@foxglove/rosmsg";
import { MessageReader, MessageWriter } from "@foxglove/rosmsg2-serialization";

const retryMs = 2000;
/** The gateway gives a call up first, and says why. */
const callMarginMs = 5000;
/** Of what the gateway says once. */
const onceShownMs = 10000;

const definitionsOf = (schema) => parse(schema, { ros2: true });

/** Keeps a connection, joins again when it is lost. Listeners get decoded messages. */
export class Connection {
  #url;
  #callTimeoutMs;
  #client;
  #channels = new Map();
  #services = new Map();
  #listeners = new Map();
  #subscriptions = new Map();
  #calls = new Map();
  #nextCall = 1;
  #published = new Map();
  #warnings = new Map();
  #heard = performance.now();

  /**
   * `callTimeoutMs`: after which the gateway gives a call up. `changed(text, isGood)`: how it is with the connection.
   * `connected()`: services may be called.
   */
  constructor(url, { callTimeoutMs, changed, connected }) {
    this.#url = url;
    this.#callTimeoutMs = callTimeoutMs + callMarginMs;
    this.changed = changed;
    this.connected = connected;
    this.#open();
  }

  /** `listener(message, nanoseconds of arrival at the gateway)`. */
  listen(topic, listener) {
    if (!this.#listeners.has(topic)) this.#listeners.set(topic, []);
    this.#listeners.get(topic).push(listener);
    this.#subscribe(topic);
  }

  /** Ends all listening to the topic. */
  unlisten(topic) {
    this.#listeners.delete(topic);
    for (const [id, entry] of this.#subscriptions) {
      if (entry.topic !== topic) continue;
      this.#client?.unsubscribe(id);
      this.#subscriptions.delete(id);
    }
  }

  get isOpen() { return this.#services.size > 0; }

  /** How long nothing at all has come. */
  get quietMs() { return performance.now() - this.#heard; }

  /** Gives the connection up, as one whose other side is gone without a word, and makes another. */
  reopen() {
    const given = this.#client;
    this.#lost();
    given.close();
  }

  hasService(name) { return this.#services.has(name); }

  /** The decoded reply. Rejects with the gateway's reason. */
  call(name, request) {
    const service = this.#services.get(name);
    if (!this.#client) return Promise.reject(new Error("there is no connection to the gateway"));
    if (!service) return Promise.reject(new Error(`the gateway offers no service ${name}`));
    service.writer ??= new MessageWriter(definitionsOf(service.request.schema));
    service.reader ??= new MessageReader(definitionsOf(service.response.schema));
    const callId = this.#nextCall++;
    this.#client.sendServiceCallRequest({ serviceId: service.id, callId, encoding: "cdr",
      data: service.writer.writeMessage(request) });
    return new Promise((resolve, reject) => {
      const timer = setTimeout(() => this.#settle(callId, (call) => call.reject(new Error(`${name} did not answer`))),
        this.#callTimeoutMs);
      this.#calls.set(callId, { service, resolve, reject, timer });
    });
  }

  /** `definition`: the message's fields as in a .msg file with those of all types it uses. */
  publish(topic, schemaName, definition, message) {
    if (!this.#published.has(topic)) {
      this.#published.set(topic, { id: this.#client.advertise({ topic, encoding: "cdr", schemaName }),
        writer: new MessageWriter(definitionsOf(definition)) });
    }
    const { id, writer } = this.#published.get(topic);
    this.#client.sendMessage(id, writer.writeMessage(message));
  }

  /** The definition of a topic's or a service's type, as the gateway told it. */
  definition(schemaName) {
    for (const { channel } of this.#channels.values()) {
      if (channel.schemaName === schemaName) return channel.schema;
    }
    return undefined;
  }

  #open() {
    this.changed("connecting", true);
    const socket = new WebSocket(this.#url, ["foxglove.websocket.v1"]);
    const client = new FoxgloveClient({ ws: socket });
    this.#client = client;
    this.#heard = performance.now();
    socket.addEventListener("message", () => { if (client === this.#client) this.#heard = performance.now(); });
    client.on("advertise", (channels) => {
      for (const channel of channels) this.#channels.set(channel.topic, { channel });
      for (const topic of this.#listeners.keys()) this.#subscribe(topic);
    });
    client.on("advertiseServices", (services) => {
      for (const service of services) this.#services.set(service.name, service);
      this.changed("connected", true);
      this.connected();
    });
    client.on("message", ({ subscriptionId, data, timestamp }) => this.#message(subscriptionId, data, timestamp));
    client.on("serviceCallResponse", ({ callId, data }) => this.#settle(callId, (call) => {
      try {
        call.resolve(call.service.reader.readMessage(new DataView(data.buffer, data.byteOffset, data.byteLength)));
      } catch (error) {
        call.reject(new Error(`an answer cannot be read: ${error.message}`));
      }
    }));
    client.on("serviceCallFailure", ({ callId, message }) => this.#settle(callId, (call) =>
      call.reject(new Error(message))));
    client.on("status", ({ level, message, id }) => {
      if (level > 0) this.#warn(id ?? `once ${message}`, { message, isGood: level < 2, isOnce: id === undefined });
    });
    client.on("removeStatus", ({ statusIds }) => {
      for (const id of statusIds) this.#warnings.delete(id);
      this.#showWarnings();
    });
    client.on("error", () => {});
    client.on("close", () => { if (client === this.#client) this.#lost(); });
  }

  #warn(id, warning) {
    this.#warnings.set(id, warning);
    this.#showWarnings();
    if (warning.isOnce) setTimeout(() => { if (this.#warnings.delete(id)) this.#showWarnings(); }, onceShownMs);
  }

  /** The worst of what holds. */
  #showWarnings() {
    const all = [...this.#warnings.values()];
    const worst = all.find(({ isGood }) => !isGood) ?? all.at(-1);
    this.changed(worst?.message ?? "connected", worst?.isGood ?? true);
  }

  #lost() {
    this.#client = undefined;
    this.#warnings.clear();
    this.changed("no gateway: trying again", false);
    this.#channels.clear();
    this.#services.clear();
    this.#subscriptions.clear();
    this.#published.clear();
    for (const callId of [...this.#calls.keys()]) {
      this.#settle(callId, (call) => call.reject(new Error("the connection was lost")));
    }
    setTimeout(() => this.#open(), retryMs);
  }

  #subscribe(topic) {
    const known = this.#channels.get(topic);
    if (!known || [...this.#subscriptions.values()].some((entry) => entry.topic === topic)) return;
    known.reader ??= new MessageReader(definitionsOf(known.channel.schema));
    this.#subscriptions.set(this.#client.subscribe(known.channel.id), { topic, reader: known.reader });
  }

  #message(subscriptionId, data, timestamp) {
    const entry = this.#subscriptions.get(subscriptionId);
    if (!entry) return;
    const message = entry.reader.readMessage(data);
    for (const listener of this.#listeners.get(entry.topic) ?? []) listener(message, timestamp);
  }

  #settle(callId, settle) {
    const call = this.#calls.get(callId);
    if (!call) return;
    this.#calls.delete(callId);
    clearTimeout(call.timer);
    settle(call);
  }
}
