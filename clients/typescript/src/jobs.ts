/** Jobs: scans that are handed over to be mended later, and outlive the connection and the service's process. */
import type { Constraints, Job, JobList, Report } from './contract.js';
import { eventsOf } from './event_stream.js';
import { ProblemError, isAbort } from './problem.js';
import { type Progress, jsonOf, pause } from './requests.js';
import type { Transport } from './transport.js';

/** What is said of a job beside its scan. */
export interface JobLabels {
  /** The client's name for it: at most 200 characters. */
  readonly name?: string;
  /** Of a client's jobs those with a higher priority start first; -100 to 100. */
  readonly priority?: number;
  /** Where the end of the job is told: an https URL. */
  readonly webhook?: string;
  /**
   * A repeated submission with the same key is answered with the first one's job. Left out, each call of `submit` has a key of its own, so that a
   * try that the service took and did not answer makes no second job.
   */
  readonly idempotencyKey?: string;
}

/** Which jobs are listed. */
export interface JobQuery {
  readonly state?: 'waiting' | 'running' | 'done' | 'error' | 'cancelled';
  /** `next` of the page before. */
  readonly from?: string;
  /** 1 to 200; 50 when left out. */
  readonly limit?: number;
}

/** How a job is waited for. */
export interface Following {
  /** The version seen last; only later ones are told. */
  readonly lastVersion?: number;
  readonly signal?: AbortSignal;
}

/** How a job is waited for to its end. */
export interface Waiting extends Following {
  /** Told of the job as it is now, and after every change. */
  readonly onChange?: (job: Job) => void;
}

/** Longest silence of a stream of events, in milliseconds: the service sends a comment every 15 seconds. */
const SILENCE = 45_000;
/** The first and the longest pause, in seconds, before a stream that broke off is opened again. */
const PAUSES = { first: 0.5, longest: 30 };

/** The jobs of a service. */
export class Jobs {
  constructor(private readonly transport: Transport) {}

  /** Hands over a scan. When this resolves, the scan is on the service's disk. */
  async submit(scan: Blob, constraints: Constraints, labels: JobLabels = {}, progress: Progress = {}): Promise<Job> {
    const form = new FormData();
    form.append('scan', scan, 'scan');
    form.append('constraints', new Blob([JSON.stringify(constraints)], { type: 'application/json' }), 'constraints');
    const { name, priority, webhook, idempotencyKey = crypto.randomUUID() } = labels;
    const path = `jobs${query({ name, priority, webhook })}`;
    return jsonOf(await this.transport.upload(path, form, progress, { 'idempotency-key': idempotencyKey }));
  }

  /** A job as it is now. */
  async get(id: string, progress: Progress = {}): Promise<Job> {
    return jsonOf(await this.transport.send(at(id), {}, progress));
  }

  /** A page of jobs, the newest first. */
  async list({ state, from, limit }: JobQuery = {}, progress: Progress = {}): Promise<JobList> {
    return jsonOf(await this.transport.send(`jobs${query({ state, from, limit })}`, {}, progress));
  }

  /** The mended scan of a job. */
  async result(id: string, progress: Progress = {}): Promise<Blob> {
    const answer = await this.transport.send(at(id, 'result'), {}, progress);
    return new Blob([answer.body], { type: answer.contentType });
  }

  /** The report of a job. */
  async report(id: string, progress: Progress = {}): Promise<Report> {
    return jsonOf(await this.transport.send(at(id, 'report'), {}, progress));
  }

  /** Cancels a job that waits or runs. One that runs is stopped soon: `cancelling` until then. */
  async cancel(id: string, progress: Progress = {}): Promise<Job> {
    return jsonOf(await this.transport.send(at(id, 'cancel'), { method: 'POST' }, progress));
  }

  /** Lets a failed or cancelled job wait again. */
  async retry(id: string, progress: Progress = {}): Promise<Job> {
    return jsonOf(await this.transport.send(at(id, 'retry'), { method: 'POST' }, progress));
  }

  /** Deletes a job in any state, with its files. */
  async delete(id: string, progress: Progress = {}): Promise<void> {
    await this.transport.send(at(id), { method: 'DELETE' }, progress);
  }

  /**
   * The job as it is now, and again after every change, until it is finished. A stream that breaks off is opened again, and goes on after the last
   * version that came.
   *
   * @throws ProblemError - The service refuses, as for a job that was deleted.
   */
  async *events(id: string, { lastVersion, signal }: Following = {}): AsyncGenerator<Job> {
    let seen = lastVersion;
    for (let pauseSeconds = PAUSES.first; ;) {
      try {
        const answer = await this.transport.open(at(id, 'events'), {
          headers: seen === undefined ? {} : { 'last-event-id': String(seen) },
          signal: signal ?? null,
        });
        if (answer.status === 204 || answer.body === null) {
          return;
        }
        for await (const event of eventsOf(answer.body, SILENCE)) {
          const job = JSON.parse(event.data) as Job;
          [seen, pauseSeconds] = [job.version, PAUSES.first];
          yield job;
          if (isFinished(job)) {
            return;
          }
        }
        // The service shuts down, or a proxy has had enough.
      } catch (error) {
        if (isAbort(error) || signal?.aborted || (error instanceof ProblemError && !isPassing(error))) {
          throw error;
        }
        pauseSeconds = Math.max(pauseSeconds, (error instanceof ProblemError && error.retryAfter) || 0);
      }
      await pause(pauseSeconds, signal);
      pauseSeconds = Math.min(2 * pauseSeconds, PAUSES.longest);
    }
  }

  /** Waits until a job is finished: done, failed or cancelled. */
  async wait(id: string, { onChange, ...following }: Waiting = {}): Promise<Job> {
    for await (const job of this.events(id, following)) {
      onChange?.(job);
      if (isFinished(job)) {
        return job;
      }
    }
    // It was finished in the version that was seen last.
    return this.get(id, following);
  }
}

/** Whether nothing will change a job any more, unless it is retried. */
export function isFinished(job: Job): boolean {
  return job.state === 'DONE' || job.state === 'ERROR' || job.state === 'CANCELLED';
}

/** Whether a refusal says nothing of the request: another try may succeed. */
function isPassing({ status }: ProblemError): boolean {
  return status === 429 || status >= 500;
}

function at(id: string, file?: string): string {
  const path = `jobs/${encodeURIComponent(id)}`;
  return file === undefined ? path : `${path}/${file}`;
}

function query(values: Record<string, string | number | undefined>): string {
  const given = Object.entries(values).filter(([, value]) => value !== undefined);
  const text = new URLSearchParams(given.map(([name, value]) => [name, String(value)])).toString();
  return text === '' ? '' : `?${text}`;
}
