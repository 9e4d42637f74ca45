/** Reads server-sent events (https://html.spec.whatwg.org/multipage/server-sent-events.html) from an answer of `fetch`. */

/** An event. */
export interface ServerEvent {
  /** Its id; the last one that came, when it has none. */
  readonly id: string;
  readonly data: string;
}

/**
 * The events of a stream, in order, until it ends.
 *
 * @param silence - Milliseconds without a byte after which the stream counts as dead.
 * @throws When the connection breaks, or nothing came for too long.
 */
export async function* eventsOf(body: ReadableStream<Uint8Array>, silence: number): AsyncGenerator<ServerEvent> {
  const reader = body.getReader();
  const decoder = new TextDecoder();
  let [rest, id, data] = ['', '', [] as string[]];
  try {
    for (;;) {
      const { done, value } = await within(reader.read(), silence);
      if (done) {
        return;
      }
      rest += decoder.decode(value, { stream: true });
      // A carriage return at the end may be half of a line's end.
      const lines = rest.split(/\r\n|\n|\r(?!$)/);
      rest = lines.pop() ?? '';
      for (const line of lines) {
        if (line === '') {
          if (data.length > 0) {
            yield { id, data: data.join('\n') };
          }
          data = [];
          continue;
        }
        const [, field, text] = /^([^:]*)(?:: ?(.*))?$/.exec(line) ?? [];
        if (field === 'data') {
          data.push(text ?? '');
        } else if (field === 'id') {
          id = text ?? '';
        }
      }
    }
  } finally {
    reader.cancel().catch(() => undefined);
  }
}

function within<T>(promise: Promise<T>, milliseconds: number): Promise<T> {
  return new Promise((resolve, reject) => {
    const timer = setTimeout(() => reject(new Error('The service says nothing any more.')), milliseconds);
    promise.then(resolve, reject).finally(() => clearTimeout(timer));
  });
}
