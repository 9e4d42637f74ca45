/** Requests to one service with the key that it takes, which somebody may be asked for. */
import { ProblemError } from './problem.js';
import { type Answer, type Progress, opened, patiently, send, upload } from './requests.js';

/** What a service takes of its clients. */
export interface ServiceOptions {
  /** The key, where the service takes keys. */
  readonly key?: string | undefined;
  /**
   * Asked for a key when the service refuses the one that was sent, or that none was sent; the request is sent again with the answer. Requests
   * that are refused meanwhile wait for the same answer. `undefined`: there is none, and the request fails.
   */
  readonly askForKey?: (refusal: ProblemError) => Promise<string | undefined>;
}

/** A request by `fetch` whose headers can be added to. */
export interface Request extends RequestInit {
  headers?: Record<string, string>;
}

/** A request with a JSON body. */
export function jsonBody(message: unknown): Request {
  return { method: 'POST', headers: { 'content-type': 'application/json' }, body: JSON.stringify(message) };
}

/** Sends requests to the service at one address. */
export class Transport {
  private key: string | undefined;
  /** The key that is being asked for. */
  private asked: Promise<string | undefined> | undefined;

  constructor(
    private readonly base: URL,
    private readonly options: ServiceOptions,
  ) {
    this.key = options.key;
  }

  /** Sends a request, and reads the answer to its end. */
  send(path: string, request: Request, progress: Progress = {}): Promise<Answer> {
    return this.withKey((key) => send(this.at(path), withKey(request, key), progress));
  }

  /** Sends a request; the answer is read as it comes. */
  open(path: string, request: Request): Promise<Response> {
    return this.withKey((key) => opened(this.at(path), withKey(request, key)));
  }

  /** The same; waits and tries again on 503. */
  openPatiently(path: string, request: Request, progress: Progress): Promise<Response> {
    return patiently(progress, () => this.open(path, request));
  }

  /** Sends a form. */
  upload(path: string, body: FormData, progress: Progress, headers: Record<string, string> = {}): Promise<Answer> {
    return this.withKey((key) =>
      upload({ url: this.at(path), headers: { ...headers, ...authorization(key) }, body }, progress),
    );
  }

  /** Sends a request of which nothing is awaited, also when the page is left. */
  forget(path: string, method: string): void {
    fetch(this.at(path), { method, keepalive: true, headers: authorization(this.key) }).catch(() => undefined);
  }

  /** Sends a request with the key, and again with another one as long as there is somebody who knows one. */
  private async withKey<T>(attempt: (key: string | undefined) => Promise<T>): Promise<T> {
    for (;;) {
      const sent = this.key;
      try {
        return await attempt(sent);
      } catch (error) {
        if (!(error instanceof ProblemError && error.keyIsRefused)) {
          throw error;
        }
        // Another request may have been given a key since this one was sent.
        if (this.key === sent) {
          const given = await this.ask(error);
          if (given === undefined) {
            throw error;
          }
          this.key = given;
        }
      }
    }
  }

  private ask(refusal: ProblemError): Promise<string | undefined> {
    this.asked ??= Promise.resolve(this.options.askForKey?.(refusal)).finally(() => (this.asked = undefined));
    return this.asked;
  }

  private at(path: string): URL {
    return new URL(path, this.base);
  }
}

function withKey(request: Request, key: string | undefined): Request {
  return { ...request, headers: { ...request.headers, ...authorization(key) } };
}

/** The header of a key; nothing without one. It never goes into an address, which logs and histories keep. */
function authorization(key: string | undefined): Record<string, string> {
  return key === undefined ? {} : { authorization: `Bearer ${key}` };
}
