/** Refusals of the service, and failures to reach it, as errors for a person. */
import type { Problem, ProblemCode } from './contract.js';

/** A field of a request that is at fault. */
export interface FieldFault {
  /** A JSON pointer (RFC 6901). */
  readonly pointer?: string;
  readonly detail?: string;
}

/** A problem document (RFC 9457) as an error. Its message is the document's `detail`, for programmers; `describeError` has words for others. */
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
    readonly fields: readonly FieldFault[] = [],
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
    const { code, detail, errors = [] } = JSON.parse(body) as Partial<Problem>;
    return new ProblemError(status, code ?? '', detail ?? unknown(status), wait, errors);
  } catch {
    return new ProblemError(status, '', unknown(status), wait);
  }
}

/** What to tell a person about any error. */
export function describeError(error: unknown): string {
  if (error instanceof ProblemError) {
    return problemInWords(error);
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

function unknown(status: number): string {
  return `The service answered with status ${status}.`;
}

/** A refusal in words: each fault once, with its place as a person calls it. */
function problemInWords({ code, message, fields }: ProblemError): string {
  if (code === 'anchor_out_of_reach' && fields.length > 0) {
    const faults = fields.map(({ pointer = '', detail = '' }) => sentence(`${placeInWords(pointer)}: ${detail}`));
    return [...faults, 'Move the point nearer to the cloth, or make the anchor soft.'].join('\n');
  }
  const inWords = ({ pointer = '', detail = '' }: FieldFault): string =>
    sentence(`${placeInWords(pointer)}: ${detail}`);
  // Most details list the faults already, by their pointers.
  if (fields.length > 0 && fields.every(({ pointer = '', detail = '' }) => message.includes(`${pointer}: ${detail}`))) {
    return fields.map(inWords).join('\n');
  }
  const others = fields.filter(({ detail = '' }) => !message.includes(detail));
  return [sentence(message), ...others.map(inWords)].join('\n');
}

/** A JSON pointer into constraints as a person calls its place, counted from 1: `Gesture 1, twist radius`. */
function placeInWords(pointer: string): string {
  const [, list = '', index = '', ...members] = pointer.split('/');
  if (!/^\d+$/.test(index)) {
    return pointer || 'The request';
  }
  if (list === 'holes') {
    // The numbers of entries say nothing to who has clicked them together.
    const [made = '', ...others] = members;
    const name = new Map([
      ['border', 'Border'],
      ['cut', 'Cut out'],
    ]).get(made);
    return name === undefined ? pointer : [name, ...others].join(', ');
  }
  const name = new Map([
    ['anchors', 'Anchor'],
    ['edits', 'Gesture'],
  ]).get(list);
  const member = members.length > 0 ? `, ${members.join(' ')}` : '';
  return name === undefined ? pointer : `${name} ${Number(index) + 1}${member}`;
}

function sentence(text: string): string {
  const capital = text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?]$/.test(capital) ? capital : `${capital}.`;
}
