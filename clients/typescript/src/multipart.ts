/** Reads multipart/mixed (RFC 2046), as the service writes it: every part with a name and a content-length. */

/** A part of an answer. */
export interface Part {
  readonly mediaType: string;
  readonly body: Uint8Array<ArrayBuffer>;
}

/**
 * The parts of a multipart/mixed answer by name.
 *
 * @throws When the bytes are not such an answer.
 */
export function partsOf(contentType: string, answer: ArrayBuffer): Map<string, Part> {
  const boundary = /boundary="?([^";]+)"?/.exec(contentType)?.[1];
  if (!contentType.startsWith('multipart/mixed') || boundary === undefined) {
    throw new Error(`multipart/mixed was asked for, ${contentType} was answered`);
  }
  const bytes = new Uint8Array(answer);
  const parts = new Map<string, Part>();
  let at = 0;
  for (;;) {
    const headEnd = find(bytes, '\r\n\r\n', at);
    if (headEnd < 0) {
      const rest = new TextDecoder().decode(bytes.subarray(at));
      if (!rest.startsWith(`--${boundary}--`)) {
        throw new Error('a multipart/mixed answer ends before its last line');
      }
      return parts;
    }
    const head = new TextDecoder().decode(bytes.subarray(at, headEnd)).toLowerCase();
    const length = Number(/content-length: *(\d+)/.exec(head)?.[1] ?? Number.NaN);
    const name = /name="([^"]*)"/.exec(head)?.[1];
    const start = headEnd + 4;
    if (!head.includes(`--${boundary.toLowerCase()}`) || name === undefined || !(start + length <= bytes.length)) {
      throw new Error('a part of a multipart/mixed answer cannot be read');
    }
    const mediaType = /content-type: *([^\r\n;]+)/.exec(head)?.[1] ?? '';
    parts.set(name, { mediaType, body: bytes.slice(start, start + length) });
    at = start + length + 2;
  }
}

/** Index of an ASCII text in `bytes`, from `from` on; -1 when it is not there. */
export function find(bytes: Uint8Array, text: string, from: number): number {
  const wanted = [...text].map((letter) => letter.charCodeAt(0));
  const last = bytes.length - wanted.length;
  for (let at = from; at <= last; at += 1) {
    if (wanted.every((byte, i) => bytes[at + i] === byte)) {
      return at;
    }
  }
  return -1;
}
