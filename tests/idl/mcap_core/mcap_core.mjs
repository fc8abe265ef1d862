// MCAP through @mcap/core, which shares no code with ours:
//   node mcap_core.mjs read FILE                    what is in it, as JSON; checks every CRC, and decodes
//                                                   every CDR message by the schema beside it
//   node mcap_core.mjs copy FROM TO '{"useChunks": false, ...}'
//                                                   the same messages, written by McapWriter with these options
import { createHash } from "node:crypto";
import { open } from "node:fs/promises";
import { createRequire } from "node:module";

// The modules lie where npm put them, in the build folder.
const require = createRequire(`${process.env.STILLMAP_NODE_FOLDER}/`);
const { McapIndexedReader, McapStreamReader, McapWriter } = require("@mcap/core");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const lz4 = require("@foxglove/wasm-lz4");
const lz4js = require("lz4js");
const zstd = require("@foxglove/wasm-zstd");

await lz4.isLoaded;
await zstd.isLoaded;

const decompressHandlers = {
  lz4: (packed, size) => lz4(packed, Number(size)),
  zstd: (packed, size) => zstd.decompress(packed, Number(size)),
};
const compressions = {
  none: undefined,
  lz4: (records) => ({ compression: "lz4", compressedData: lz4js.compress(records) }),
  zstd: (records) => ({ compression: "zstd", compressedData: zstd.compress(records) }),
};

class Readable {
  constructor(handle) {
    this.handle = handle;
  }
  async size() {
    return BigInt((await this.handle.stat()).size);
  }
  async read(offset, size) {
    const buffer = new Uint8Array(Number(size));
    const { bytesRead } = await this.handle.read(buffer, 0, buffer.length, Number(offset));
    if (bytesRead !== buffer.length) throw new Error(`only ${bytesRead} bytes at ${offset}`);
    return buffer;
  }
}

class Writable {
  constructor(handle) {
    this.handle = handle;
    this.written = 0n;
  }
  async write(bytes) {
    await this.handle.writeFile(bytes);
    this.written += BigInt(bytes.length);
  }
  position() {
    return this.written;
  }
}

async function indexedReader(file) {
  const readable = new Readable(await open(file));
  return McapIndexedReader.Initialize({ readable, decompressHandlers });
}

/** Message by message, as a player of files over the network reads them. */
async function streamed(file) {
  const reader = new McapStreamReader({ validateCrcs: true, decompressHandlers });
  const channels = new Map();
  const messages = [];
  for await (const piece of (await open(file)).createReadStream()) {
    reader.append(piece);
    for (let record; (record = reader.nextRecord()); ) {
      if (record.type === "Channel") channels.set(record.id, record);
      if (record.type === "Message") messages.push(digest(channels.get(record.channelId), record));
    }
  }
  if (!reader.done()) throw new Error("the stream does not end");
  return messages;
}

function digest(channel, message) {
  const hash = createHash("sha256").update(message.data).digest("hex").slice(0, 16);
  return `${channel.topic} ${message.logTime} ${message.sequence} ${hash}`;
}

function messageReader(schema) {
  return new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true }));
}

async function read(file) {
  const reader = await indexedReader(file);
  const topics = {};
  const decoders = new Map();
  for (const channel of reader.channelsById.values()) {
    const schema = reader.schemasById.get(channel.schemaId);
    if (schema.encoding === "ros2msg") decoders.set(channel.id, messageReader(schema));
    topics[channel.topic] = {
      type: schema.name,
      schema_encoding: schema.encoding,
      message_encoding: channel.messageEncoding,
      qos: channel.metadata.get("offered_qos_profiles") ?? "",
      messages: Number(reader.statistics?.channelMessageCounts.get(channel.id) ?? 0),
    };
  }
  const messages = [];
  let decoded = 0;
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    messages.push(digest(reader.channelsById.get(message.channelId), message));
    if (!decoders.has(message.channelId)) continue;
    decoders.get(message.channelId).readMessage(message.data);
    ++decoded;
  }
  const inStream = await streamed(file);
  if (inStream.sort().join("\n") !== [...messages].sort().join("\n")) {
    throw new Error("the index leads to other messages than the stream has");
  }
  return {
    profile: reader.header.profile,
    chunks: reader.chunkIndexes.length,
    compressions: [...new Set(reader.chunkIndexes.map((chunk) => chunk.compression))],
    topics,
    messages,
    decoded,
  };
}

async function copy(from, to, options) {
  const reader = await indexedReader(from);
  const { compression, ...others } = options;
  const handle = await open(to, "w");
  const writer = new McapWriter({
    writable: new Writable(handle),
    compressChunk: compressions[compression ?? "none"],
    ...others,
  });
  await writer.start({ profile: "ros2", library: "" });
  const channels = new Map();
  for await (const message of reader.readMessages()) {
    if (!channels.has(message.channelId)) {
      const channel = reader.channelsById.get(message.channelId);
      const schemaId = await writer.registerSchema(reader.schemasById.get(channel.schemaId));
      channels.set(message.channelId, await writer.registerChannel({ ...channel, schemaId }));
    }
    await writer.addMessage({ ...message, channelId: channels.get(message.channelId) });
  }
  await writer.end();
  await handle.close();
}

const [command, ...files] = process.argv.slice(2);
if (command === "read") {
  console.log(JSON.stringify(await read(files[0])));
} else {
  await copy(files[0], files[1], JSON.parse(files[2]));
}
