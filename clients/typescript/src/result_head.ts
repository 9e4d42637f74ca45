/** Reads the beginning of a mended scan as it comes: the report, and what the glTF says beside its buffers. */
import type { Report } from './contract.js';
import { find } from './multipart.js';

/** How a session's scan was mended, without the scan's buffers. */
export interface ResultHead {
  readonly report: Report;
  /** The JSON of the mended glTF. */
  readonly document: unknown;
}

/** Bytes of a GLB before its JSON: its header, and that of its first chunk. */
const BEFORE_JSON = 20;

/**
 * Reads an answer of the parts `report` and `scan`, a glTF, as far as the end of its JSON. The rest is not fetched.
 *
 * @throws When the answer is something else.
 */
export async function headOfResult(response: Response): Promise<ResultHead> {
  const reader = response.body?.getReader();
  if (reader === undefined) {
    throw new Error('the answer has no body');
  }
  const bytes = new Bytes(reader);
  try {
    const report = JSON.parse(text(await bytes.take(await bytes.partLength()))) as Report;
    const length = await bytes.partLength();
    const start = await bytes.take(Math.min(BEFORE_JSON, length));
    const json =
      text(start.subarray(0, 4)) === 'glTF'
        ? text(await bytes.take(new DataView(start.buffer).getUint32(12, true)))
        : text(start) + text(await bytes.take(length - start.length));
    return { report, document: JSON.parse(json) as unknown };
  } finally {
    await reader.cancel();
  }
}

/** Bytes that are taken as they come. */
class Bytes {
  private held = new Uint8Array(0);

  constructor(private readonly reader: ReadableStreamDefaultReader<Uint8Array>) {}

  /** The next bytes, in a buffer of their own. */
  async take(count: number): Promise<Uint8Array<ArrayBuffer>> {
    const chunks: Uint8Array[] = [this.held];
    for (let size = this.held.length; size < count; size += (chunks.at(-1) as Uint8Array).length) {
      chunks.push(await this.next());
    }
    const all = joined(chunks);
    this.held = all.slice(count);
    return all.slice(0, count);
  }

  /** Goes behind the lines before a part, which say its length in bytes. */
  async partLength(): Promise<number> {
    for (;;) {
      const end = find(this.held, '\r\n\r\n', 0);
      if (end >= 0) {
        const length = /content-length: *(\d+)/i.exec(text(this.held.subarray(0, end)))?.[1];
        if (length === undefined) {
          throw new Error('a part of the answer has no length');
        }
        this.held = this.held.slice(end + 4);
        return Number(length);
      }
      this.held = joined([this.held, await this.next()]);
    }
  }

  private async next(): Promise<Uint8Array> {
    const { value } = await this.reader.read();
    if (value === undefined) {
      throw new Error('the answer ends before the scan does');
    }
    return value;
  }
}

function joined(chunks: readonly Uint8Array[]): Uint8Array<ArrayBuffer> {
  const all = new Uint8Array(chunks.reduce((sum, chunk) => sum + chunk.length, 0));
  let at = 0;
  for (const chunk of chunks) {
    all.set(chunk, at);
    at += chunk.length;
  }
  return all;
}

function text(bytes: Uint8Array): string {
  return new TextDecoder().decode(bytes);
}
