/** Refusals of the service, and failures to reach it, as errors for a person. */
import type { Problem, ProblemCode } from './contract.js';

/** A problem document (RFC 9457) as an error. */
export class ProblemError extends Error {
  override readonly name = 'ProblemError';

  constructor(
    readonly status: number,
    /**
     * Stable word for programs, such as `queue_full`; empty when the answer was not the service's own. A later version of the service may have
     * other words.
     */
    readonly code: ProblemCode | (string & {}),
    detail: string,
    /** Seconds after which another try may succeed. */
    readonly retryAfter: number | undefined,
  ) {
    super(detail);
  }

  /** Whether the service takes keys, and the request had none that it takes. */
  get keyIsRefused(): boolean {
    return this.status === 401;
  }

  /** Whether the session that the request named is gone. */
  get sessionIsGone(): boolean {
    return this.status === 410 || this.code === 'session_not_found';
  }
}

/** The error that an answer with a status of 400 or above stands for. */
export function problemOf(status: number, retryAfter: string | null, body: string): ProblemError {
  const seconds = Number(retryAfter ?? Number.NaN);
  const wait = Number.isFinite(seconds) && seconds >= 0 ? seconds : undefined;
  try {
    const problem = JSON.parse(body) as Problem;
    const fields = (problem.errors ?? []).map((field) => `\n${field.pointer ?? ''} ${field.detail}`);
    return new ProblemError(status, problem.code, problem.detail + fields.join(''), wait);
  } catch {
    return new ProblemError(status, '', `The service answered with status ${status}.`, wait);
  }
}

/** What to tell a person about any error. */
export function describeError(error: unknown): string {
  if (error instanceof ProblemError) {
    return sentence(error.message);
  }
  if (error instanceof TypeError && /fetch|network/i.test(error.message)) {
    return 'The service cannot be reached.';
  }
  return sentence(error instanceof Error ? error.message : String(error));
}

/** Whether an error only says that the person, or a newer request, stopped it. */
export function isAbort(error: unknown): boolean {
  return error instanceof DOMException && error.name === 'AbortError';
}

function sentence(text: string): string {
  const capital = text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?]$/.test(capital) ? capital : `${capital}.`;
}
