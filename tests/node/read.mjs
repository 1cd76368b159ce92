// Reads a recording in full with the reference implementation, CRCs checked, and prints what it held as JSON.
// Twice: sequentially (chunk and data section CRCs) and by the index (summary CRC, chunk index, statistics).
import { readFile } from "node:fs/promises";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";

const path = process.argv[2];
const decompressHandlers = await loadDecompressHandlers();

const topics = new Map();
const sequential = {};
const metadata = [];
const attachments = [];
const reader = new McapStreamReader({ validateCrcs: true, decompressHandlers });
const bytes = await readFile(path);
reader.append(bytes);
for (let record; (record = reader.nextRecord()); ) {
  if (record.type === "Channel") {
    topics.set(record.id, record.topic);
  } else if (record.type === "Message") {
    const topic = topics.get(record.channelId);
    sequential[topic] = (sequential[topic] ?? 0) + 1;
  } else if (record.type === "Metadata") {
    metadata.push(record.name);
  } else if (record.type === "Attachment") {
    attachments.push(record.name);
  }
}
if (!reader.done()) {
  throw new Error("the file ends before its closing magic");
}

const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, length) => new Uint8Array(bytes.buffer, bytes.byteOffset + Number(offset), Number(length)),
};
const indexed = {};
const file = await McapIndexedReader.Initialize({ readable, decompressHandlers });
for await (const message of file.readMessages({ validateCrcs: true })) {
  const topic = file.channelsById.get(message.channelId).topic;
  indexed[topic] = (indexed[topic] ?? 0) + 1;
}
const stated = {};
for (const [id, count] of file.statistics.channelMessageCounts) {
  stated[file.channelsById.get(id).topic] = Number(count);
}
console.log(JSON.stringify({ sequential, indexed, stated, metadata, attachments }));
