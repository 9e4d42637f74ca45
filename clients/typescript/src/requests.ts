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

/** Sends a form by XMLHttpRequest, which unlike `fetch` tells how much was sent. Waits and tries again on 503. */
export function upload(form: Upload, progress: Progress = {}): Promise<Answer> {
  return patiently(progress, () => uploadOnce(form, progress));
}

/** Sends a request by `fetch`. Waits and tries again on 503. */
export function send(url: URL, init: RequestInit, progress: Progress = {}): Promise<Answer> {
  return patiently(progress, async () => {
    const response = await fetched(url, init, progress);
    return { contentType: response.headers.get('content-type') ?? '', body: await response.arrayBuffer() };
  });
}

/**
 * Sends a request whose answer is JSON messages, one a line, that come while they are made, and hands each on. Aborting the signal ends the answer.
 * Waits and tries again on 503.
 */
export async function sendForLines<T>(
  url: URL,
  init: RequestInit,
  onLine: (line: T) => void,
  progress: Progress = {},
): Promise<void> {
  const response = await patiently(progress, () => fetched(url, init, progress));
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

async function fetched(url: URL, init: RequestInit, { signal }: Progress): Promise<Response> {
  const response = await fetch(url, { ...init, signal: signal ?? null });
  if (!response.ok) {
    throw problemOf(response.status, response.headers.get('retry-after'), await response.text());
  }
  return response;
}

async function patiently<T>(progress: Progress, attempt: () => Promise<T>): Promise<T> {
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

function pause(seconds: number, signal: AbortSignal | undefined): Promise<void> {
  return new Promise((resolve, reject) => {
    const timer = setTimeout(resolve, seconds * 1000);
    signal?.addEventListener('abort', () => {
      clearTimeout(timer);
      reject(new DOMException('stopped', 'AbortError'));
    });
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
