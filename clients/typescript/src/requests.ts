/** Sends requests: uploads with progress, waiting where the service asks for it, problem documents as errors. */
import { ProblemError, problemOf } from './problem.js';

/** Tries of one request that the service answers with 503. */
const MOST_TRIES = 5;
/** Longest wait before another try, in seconds. */
const LONGEST_WAIT = 60;

/** An answer with a status below 400. */
export interface Answer {
  readonly contentType: string;
  readonly body: ArrayBuffer;
}

/** What a caller may be told while a request is under way. */
export interface Progress {
  /** The share of the body that has been sent, from 0 to 1. */
  onSent?: (share: number) => void;
  /** The service is busy; the request is sent again after so many seconds. */
  onWait?: (seconds: number) => void;
  signal?: AbortSignal;
}

/** A form that is posted to an address. */
export interface Upload {
  readonly url: URL;
  readonly headers: Readonly<Record<string, string>>;
  readonly body: FormData;
}

/**
 * Sends a form by XMLHttpRequest, which unlike `fetch` tells how much was sent; by `fetch` where there is none, as in Node. Waits and tries again on
 * 503.
 */
export function upload(form: Upload, progress: Progress = {}): Promise<Answer> {
  if (typeof XMLHttpRequest === 'undefined') {
    return send(form.url, { method: 'POST', headers: form.headers, body: form.body }, progress);
  }
  return patiently(progress, () => uploadOnce(form, progress));
}

/** Sends a request by `fetch`. Waits and tries again on 503. */
export function send(url: URL, init: RequestInit, progress: Progress = {}): Promise<Answer> {
  return patiently(progress, async () => {
    const response = await opened(url, { ...init, signal: progress.signal ?? null });
    return { contentType: response.headers.get('content-type') ?? '', body: await response.arrayBuffer() };
  });
}

/** Sends a request by `fetch` once; the answer is read as it comes. */
export async function opened(url: URL, init: RequestInit): Promise<Response> {
  const response = await fetch(url, init);
  if (!response.ok) {
    throw problemOf(response.status, response.headers.get('retry-after'), await response.text());
  }
  return response;
}

/** Hands on the messages of an answer that is JSON, one a line, as they come. */
export async function linesOf<T>(response: Response, onLine: (line: T) => void): Promise<void> {
  const reader = response.body?.getReader();
  const decoder = new TextDecoder();
  let rest = '';
  for (;;) {
    const { done, value } = (await reader?.read()) ?? { done: true, value: undefined };
    rest += decoder.decode(value, { stream: !done });
    const lines = rest.split('\n');
    rest = done ? '' : (lines.pop() ?? '');
    for (const line of lines.filter((it) => it !== '')) {
      onLine(JSON.parse(line) as T);
    }
    if (done) {
      return;
    }
  }
}

/** The answer's body as JSON. */
export function jsonOf<T>(answer: Answer): T {
  return JSON.parse(new TextDecoder().decode(answer.body)) as T;
}

export async function patiently<T>(progress: Progress, attempt: () => Promise<T>): Promise<T> {
  for (let tries = 1; ; tries += 1) {
    try {
      return await attempt();
    } catch (error) {
      const wait = error instanceof ProblemError && error.status === 503 ? error.retryAfter : undefined;
      if (wait === undefined || wait > LONGEST_WAIT || tries === MOST_TRIES) {
        throw error;
      }
      progress.onWait?.(wait);
      await pause(wait, progress.signal);
    }
  }
}

/** Waits, unless that is stopped. */
export function pause(seconds: number, signal: AbortSignal | undefined): Promise<void> {
  return new Promise((resolve, reject) => {
    const stop = (): void => {
      clearTimeout(timer);
      reject(new DOMException('stopped', 'AbortError'));
    };
    const timer = setTimeout(() => {
      signal?.removeEventListener('abort', stop);
      resolve();
    }, seconds * 1000);
    if (signal?.aborted) {
      stop();
    }
    signal?.addEventListener('abort', stop, { once: true });
  });
}

function uploadOnce({ url, headers, body }: Upload, { onSent, signal }: Progress): Promise<Answer> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open('POST', url);
    for (const [name, value] of Object.entries(headers)) {
      request.setRequestHeader(name, value);
    }
    request.responseType = 'arraybuffer';
    request.upload.onprogress = (event) => {
      if (event.lengthComputable && event.total > 0) {
        onSent?.(event.loaded / event.total);
      }
    };
    request.onload = () => {
      const answer = request.response as ArrayBuffer;
      if (request.status < 400) {
        resolve({ contentType: request.getResponseHeader('content-type') ?? '', body: answer });
      } else {
        const text = new TextDecoder().decode(answer);
        reject(problemOf(request.status, request.getResponseHeader('retry-after'), text));
      }
    };
    request.onerror = () => reject(new Error('The service cannot be reached, or it closed the connection.'));
    request.onabort = () => reject(new DOMException('stopped', 'AbortError'));
    signal?.addEventListener('abort', () => request.abort());
    request.send(body);
  });
}
