// Reads an MCAP file that vantage-log wrote with the format's own reader, indexed and as a stream with all CRCs checked,
// and compares it with the LCM log it comes from, which is read here anew: counts, times, payloads, depth images.
//   node check_mcap.mjs READER LOG MCAP INFO FEWEST_CHUNKS
// READER: folder of scripts/fetch-mcap-reader; INFO: what `vantage-log info` said of the log.

import assert from 'node:assert/strict';
import fs from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';

const [reader, logPath, mcapPath, infoPath, fewestChunks] = process.argv.slice(2);
const require = createRequire(path.resolve(reader) + '/');
const { McapIndexedReader, McapStreamReader } = require('@mcap/core');
const fzstd = require('fzstd');

const decompressHandlers = { zstd: (bytes, size) => fzstd.decompress(bytes, new Uint8Array(Number(size))) };

// --- The log, all its parts.
function readLog(first) {
  const events = [];
  const { dir, name, ext } = path.parse(first);
  for (let part = 0; ; ++part) {
    const file = part === 0 ? first : path.join(dir, `${name}.${part}${ext}`);
    if (!fs.existsSync(file)) return events;
    const bytes = fs.readFileSync(file);
    for (let at = 0; at < bytes.length; ) {
      assert.equal(bytes.readUInt32BE(at), 0xeda1da01);
      const channelBytes = bytes.readUInt32BE(at + 20), dataBytes = bytes.readUInt32BE(at + 24);
      const channel = bytes.toString('latin1', at + 28, at + 28 + channelBytes);
      const data = bytes.subarray(at + 28 + channelBytes, at + 28 + channelBytes + dataBytes);
      events.push({ number: bytes.readBigInt64BE(at + 4), utime: bytes.readBigInt64BE(at + 12), channel, data });
      at += 28 + channelBytes + dataBytes;
    }
  }
}

// --- The MCAP, twice.
async function readIndexed(file) {
  const handle = fs.openSync(file);
  const readable = {
    size: async () => BigInt(fs.fstatSync(handle).size),
    read: async (offset, size) => {
      const bytes = new Uint8Array(Number(size));
      assert.equal(fs.readSync(handle, bytes, 0, bytes.length, Number(offset)), bytes.length);
      return bytes;
    },
  };
  const mcap = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  assert.ok(mcap.chunkIndexes.length >= Number(fewestChunks), `${mcap.chunkIndexes.length} chunks`);
  assert.ok(mcap.summaryOffsetsByOpcode.size >= 4);
  assert.equal(mcap.statistics.chunkCount, mcap.chunkIndexes.length);
  assert.equal(mcap.statistics.channelCount, mcap.channelsById.size);
  assert.equal(mcap.statistics.schemaCount, mcap.schemasById.size);
  const messages = [];
  for await (const message of mcap.readMessages({ validateCrcs: true })) {
    messages.push({ ...message, topic: mcap.channelsById.get(message.channelId).topic });
  }
  const times = messages.map((m) => m.logTime);
  assert.equal(mcap.statistics.messageStartTime, times.reduce((a, b) => (a < b ? a : b)));
  assert.equal(mcap.statistics.messageEndTime, times.reduce((a, b) => (a > b ? a : b)));
  // The index finds one topic's messages in one span of time without the others.
  const [from, to] = [times[Math.floor(times.length / 4)], times[Math.floor(times.length / 2)]];
  const topics = [messages[Math.floor(messages.length / 3)].topic];
  let found = 0;
  for await (const message of mcap.readMessages({ topics, startTime: from, endTime: to })) {
    assert.equal(mcap.channelsById.get(message.channelId).topic, topics[0]);
    ++found;
  }
  assert.equal(found, messages.filter((m) => m.topic === topics[0] && m.logTime >= from && m.logTime <= to).length);
  return { mcap, messages };
}

function readStream(file) {
  const stream = new McapStreamReader({ validateCrcs: true, decompressHandlers });
  stream.append(fs.readFileSync(file));
  const topics = new Map(), messages = [];
  let footer = false;
  for (let record; (record = stream.nextRecord()); ) {
    if (record.type === 'Channel') topics.set(record.id, record.topic);
    if (record.type === 'Message') messages.push({ ...record, topic: topics.get(record.channelId) });
    if (record.type === 'DataEnd') assert.notEqual(record.dataSectionCrc, 0);
    if (record.type === 'Footer') footer = record.summaryCrc !== 0;
  }
  assert.ok(stream.done() && footer);
  return messages;
}

// --- Messages taken apart by hand, as their .lcm files say.
const decoders = {
  VANTAGE_ROBOT_STATE_1: (b) => ({
    utime: Number(b.readBigInt64BE(8)), session: String(b.readBigInt64BE(16)), planner: String(b.readBigInt64BE(24)),
    goal_id: Number(b.readBigInt64BE(32)), activity: b.readInt8(40),
    position: [0, 1, 2].map((i) => b.readDoubleBE(41 + 8 * i)),
    quaternion_xyzw: [0, 1, 2, 3].map((i) => b.readDoubleBE(65 + 8 * i)),
  }),
  VANTAGE_MOTION_GOAL_1: (b) => ({
    utime: Number(b.readBigInt64BE(8)), planner: String(b.readBigInt64BE(16)), goal_id: Number(b.readBigInt64BE(24)),
    view_id: Number(b.readBigInt64BE(32)), position: [0, 1, 2].map((i) => b.readDoubleBE(40 + 8 * i)),
    quaternion_xyzw: [0, 1, 2, 3].map((i) => b.readDoubleBE(64 + 8 * i)),
  }),
  VANTAGE_SESSION_CONFIG_1: (b) => ({
    utime: Number(b.readBigInt64BE(8)), yaml: b.toString('utf8', 20, 20 + b.readInt32BE(16) - 1),
  }),
  VANTAGE_DEPTH_CHUNK_1: (b) => ({
    utime: Number(b.readBigInt64BE(8)), session: String(b.readBigInt64BE(16)), map_id: Number(b.readBigInt64BE(24)),
    index: b.readInt32BE(32), size: b.readInt32BE(36), data: b.subarray(40).toString('base64'),
  }),
};

// Depth and state of a depth_map_t, as depth_codec.h says.
function unpackDepthMap(b) {
  const width = b.readInt32BE(48), height = b.readInt32BE(52), pixels = width * height;
  const [low, high] = [b.readDoubleBE(144), b.readDoubleBE(152)];
  const planes = fzstd.decompress(b.subarray(164));
  assert.equal(planes.length, 4 * pixels);
  const depth = [];
  for (let i = 0, code = 0, state = 0; i < pixels; ++i) {
    if (i % width === 0) code = state = 0;
    code = (code + (planes[i] << 8) + planes[pixels + i]) & 0xffff;
    state = (state + planes[3 * pixels + i]) & 0xff;
    depth.push(state >= 1 && state <= 3 ? 1 / (low + ((high - low) / 65535) * code) : NaN);
  }
  return { width, height, depth };
}

function checkDepthImage(event, message) {
  const image = JSON.parse(Buffer.from(message.data).toString());
  const map = unpackDepthMap(event.data);
  assert.deepEqual([image.width, image.height, image.step, image.encoding], [map.width, map.height, 4 * map.width, '32FC1']);
  const data = Buffer.from(image.data, 'base64');
  assert.equal(data.length, 4 * map.depth.length);
  map.depth.forEach((z, i) => {
    const shown = data.readFloatLE(4 * i);
    assert.ok(Number.isNaN(z) ? Number.isNaN(shown) : Math.abs(shown - z) < 1e-6 * z, `pixel ${i}: ${shown}, not ${z}`);
  });
}

function checkAgainstSchema(json, schema) {
  assert.deepEqual(Object.keys(json).sort(), Object.keys(schema.properties).sort());
  for (const [name, value] of Object.entries(json)) {
    const { type } = schema.properties[name];
    const is = Array.isArray(value) ? 'array' : Number.isInteger(value) && type === 'integer' ? 'integer' : typeof value;
    assert.equal(is, type, `${schema.title}.${name}`);
  }
}

const events = readLog(logPath);
const { mcap, messages } = await readIndexed(mcapPath);
const streamed = readStream(mcapPath);
const plain = (m) => [m.topic, m.logTime, m.publishTime, m.sequence, Buffer.from(m.data).toString('base64')].join(' ');
assert.deepEqual(messages.map(plain).sort(), streamed.map(plain).sort());
assert.equal(mcap.statistics.messageCount, BigInt(messages.length));

const byTopic = new Map();
for (const message of streamed) byTopic.set(message.topic, [...(byTopic.get(message.topic) ?? []), message]);
const byChannel = new Map();
for (const event of events) byChannel.set(event.channel, [...(byChannel.get(event.channel) ?? []), event]);

// Every topic's schema fits every message; statistics count them.
for (const channel of mcap.channelsById.values()) {
  const own = byTopic.get(channel.topic);
  assert.equal(mcap.statistics.channelMessageCounts.get(channel.id), BigInt(own.length));
  if (channel.schemaId === 0) continue;
  const schema = mcap.schemasById.get(channel.schemaId);
  assert.equal(schema.encoding, 'jsonschema');
  assert.equal(channel.messageEncoding, 'json');
  const properties = JSON.parse(Buffer.from(schema.data).toString());
  assert.equal(properties.title, schema.name);
  for (const message of own) checkAgainstSchema(JSON.parse(Buffer.from(message.data).toString()), properties);
}

// Every event is there, in order, at its time, with its content.
let payloads = 0;
for (const [channel, own] of byChannel) {
  const told = byTopic.get(channel) ?? [];
  assert.equal(told.length, own.length, channel);
  own.forEach((event, i) => {
    assert.equal(told[i].logTime, event.utime * 1000n);
    assert.equal(BigInt(told[i].sequence), event.number);
    const known = mcap.channelsById.get(told[i].channelId).schemaId !== 0;
    if (!known) assert.deepEqual(Buffer.from(told[i].data), Buffer.from(event.data));
    if (decoders[channel]) assert.deepEqual(JSON.parse(Buffer.from(told[i].data).toString()), decoders[channel](event.data));
    if (!known || decoders[channel]) ++payloads;
    if (known) assert.equal(told[i].publishTime, event.data.readBigInt64BE(8) * 1000n);
  });
}

// Each whole depth map is an image that was made from its very event.
const images = byTopic.get('/depth/image') ?? [];
for (const event of byChannel.get('VANTAGE_DEPTH_MAP_1') ?? []) {
  const image = images.find((m) => BigInt(m.sequence) === event.number);
  assert.ok(image, `no image of event ${event.number}`);
  checkDepthImage(event, image);
}

// `vantage-log info` tells the same of every channel.
const first = events.reduce((a, e) => (e.utime < a ? e.utime : a), events[0].utime);
const lines = fs.readFileSync(infoPath, 'utf8').split('\n').map((line) => line.split(/\s+/)).filter((w) => byChannel.has(w[0]));
assert.equal(lines.length, byChannel.size);
for (const [channel, , , count, , bytes, from, to] of lines) {
  const told = byTopic.get(channel);
  assert.equal(told.length, Number(count), channel);
  assert.equal(byChannel.get(channel).reduce((sum, e) => sum + e.data.length, 0), Number(bytes));
  const seconds = told.map((m) => Number(m.logTime / 1000n - first) / 1e6);
  assert.ok(Math.abs(Math.min(...seconds) - Number(from)) < 1e-6 && Math.abs(Math.max(...seconds) - Number(to)) < 1e-6);
}
console.log(`${events.length} events, ${messages.length} messages, ${mcap.chunkIndexes.length} chunks, ` +
  `${payloads} payloads and ${images.length} depth images compared`);
