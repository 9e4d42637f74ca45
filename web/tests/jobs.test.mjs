// Jobs of the client, in Node: against a server that breaks off as a test says, and against the built darn.

import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import { PATIENCE, startService } from './browser.mjs';
import { load } from './sources.mjs';

const { ProblemError, Service, isFinished } = await load('client.ts');

/** A server that answers the nth request by the nth function, and what it was asked. */
async function fake(...answers) {
  const asked = [];
  const server = createServer(async (request, response) => {
    const pieces = [];
    for await (const piece of request) {
      pieces.push(piece);
    }
    const { method, url, headers } = request;
    asked.push({ method, url, headers, body: Buffer.concat(pieces).toString() });
    const answer = answers[asked.length - 1];
    assert.ok(answer, `nobody expected ${method} ${url}`);
    await answer(response);
  });
  await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
  const { port } = server.address();
  return {
    asked,
    jobs: new Service(new URL(`http://127.0.0.1:${port}/`), { key: 'darn_x' }).jobs,
    stop: () => {
      server.closeAllConnections();
      return new Promise((resolve) => server.close(resolve));
    },
  };
}

const json = (message, status = 200) => {
  return (response) => response.writeHead(status, { 'content-type': 'application/json' }).end(JSON.stringify(message));
};
const problem = (status, code, headers = {}) => {
  return (response) => response.writeHead(status, headers).end(JSON.stringify({ status, code, detail: 'it is so' }));
};
const event = (version, state) =>
  `id: ${version}\nevent: job\ndata: ${JSON.stringify({ id: 'a', version, state })}\n\n`;
/** Sends events in pieces, then ends the stream or, with `break`, the connection. */
const events = (pieces, how = 'end') => {
  return async (response) => {
    response.writeHead(200, { 'content-type': 'text/event-stream' });
    for (const piece of pieces) {
      response.write(piece);
      await new Promise((resolve) => setTimeout(resolve, 20));
    }
    how === 'end' ? response.end() : response.destroy();
  };
};

test('a stream that breaks off goes on after the last version', { timeout: PATIENCE }, async () => {
  const whole = event(2, 'RUNNING');
  const server = await fake(
    // Cut anywhere, with comments and Windows' line ends.
    events(
      [`:\n\n${event(1, 'WAITING')}`, whole.slice(0, 9), whole.slice(9).replaceAll('\n', '\r\n'), 'id: 3\nda'],
      'break',
    ),
    problem(503, 'draining', { 'retry-after': '0' }),
    events([':\n\n']),
    events([event(3, 'RUNNING'), event(4, 'DONE')]),
  );
  const seen = [];
  const job = await server.jobs.wait('a', { onChange: (it) => seen.push(it.version) });
  assert.deepEqual([job.version, job.state], [4, 'DONE']);
  assert.deepEqual(seen, [1, 2, 3, 4]);
  assert.deepEqual(
    server.asked.map(({ url, headers }) => [url, headers['last-event-id'], headers.authorization]),
    [undefined, '2', '2', '2'].map((id) => ['/jobs/a/events', id, 'Bearer darn_x']),
  );
  await server.stop();
});

test('a job that was seen finished is fetched, and a deleted one is an error', { timeout: PATIENCE }, async () => {
  const server = await fake(
    (response) => response.writeHead(204).end(),
    json({ id: 'a', version: 4, state: 'ERROR' }),
    problem(404, 'no_such_job'),
  );
  const job = await server.jobs.wait('a', { lastVersion: 4 });
  assert.equal(job.state, 'ERROR');
  assert.equal(server.asked[0].headers['last-event-id'], '4');
  await assert.rejects(server.jobs.wait('a'), (error) => error instanceof ProblemError && error.code === 'no_such_job');
  await server.stop();
});

test('waiting can be stopped, in a stream and between two', { timeout: PATIENCE }, async () => {
  const server = await fake(
    async (response) => {
      response.writeHead(200, { 'content-type': 'text/event-stream' });
      response.write(event(1, 'WAITING'));
    },
    problem(503, 'draining', { 'retry-after': '60' }),
  );
  const stop = new AbortController();
  const waiting = server.jobs.wait('a', { signal: stop.signal, onChange: () => stop.abort() });
  await assert.rejects(waiting, { name: 'AbortError' });
  const late = new AbortController();
  setTimeout(() => late.abort(), 200);
  await assert.rejects(server.jobs.wait('a', { signal: late.signal }), { name: 'AbortError' });
  await server.stop();
});

test('a submission says all of it, and a repeated try makes no second job', { timeout: PATIENCE }, async () => {
  const accepted = json({ id: 'a', version: 1, state: 'WAITING' }, 202);
  const server = await fake(problem(503, 'uploads_full', { 'retry-after': '0' }), accepted, accepted);
  const scan = new Blob(['{}'], { type: 'model/gltf+json' });
  const labels = { name: 'coat & hat', priority: -3, webhook: 'https://example.org/?a=b' };
  const job = await server.jobs.submit(scan, { up: [0, 1, 0] }, labels);
  assert.equal(job.id, 'a');
  const url = new URL(server.asked[1].url, 'http://service');
  assert.deepEqual(Object.fromEntries(url.searchParams), { ...labels, priority: '-3' });
  assert.ok(server.asked[1].body.includes('{"up":[0,1,0]}'));
  const [first, second] = server.asked.map(({ headers }) => headers['idempotency-key']);
  assert.ok(first.length > 0);
  assert.equal(first, second);
  await server.jobs.submit(scan, {}, { idempotencyKey: 'coat-7' });
  assert.equal(server.asked[2].headers['idempotency-key'], 'coat-7');
  assert.equal(server.asked[2].url, '/jobs');
  await server.stop();
});

/** A darn that runs elsewhere may keep no jobs. */
const skip = process.env.DARN_URL !== undefined;

test('jobs of the built darn', { timeout: 4 * PATIENCE, skip }, async () => {
  const folder = mkdtempSync(join(tmpdir(), 'darn-jobs-'));
  const service = await startService(['--data', folder]);
  try {
    const { jobs } = new Service(new URL(service.url));
    const scan = new Blob([readFileSync(new URL('../../examples/scarf_hole.glb', import.meta.url))]);
    const states = [];
    const { id } = await jobs.submit(scan, {}, { name: 'scarf', idempotencyKey: 'scarf-1' });
    const done = await jobs.wait(id, { onChange: (job) => states.push(job.state) });
    assert.equal(done.state, 'DONE');
    assert.equal(states.at(-1), 'DONE');
    assert.equal((await jobs.submit(scan, {}, { name: 'scarf', idempotencyKey: 'scarf-1' })).id, id);
    const [result, report] = await Promise.all([jobs.result(id), jobs.report(id)]);
    assert.equal(Buffer.from(await result.arrayBuffer()).toString('latin1', 0, 4), 'glTF');
    assert.equal(report.holes.length, 1);

    const broken = await jobs.submit(new Blob(['{}'], { type: 'model/gltf+json' }), {});
    const failed = await jobs.wait(broken.id);
    assert.equal(failed.state, 'ERROR');
    assert.ok(isFinished(failed) && failed.problem.code.length > 0);
    await jobs.retry(broken.id);
    assert.equal((await jobs.wait(broken.id)).state, 'ERROR');
    await assert.rejects(jobs.result(broken.id), { code: 'job_wrong_state' });
    await assert.rejects(jobs.cancel(broken.id), { code: 'job_wrong_state' });
    const page = await jobs.list({ limit: 1, state: 'done' });
    assert.deepEqual(
      page.jobs.map((job) => job.id),
      [id],
    );
    await jobs.delete(id);
    await assert.rejects(jobs.get(id), { code: 'no_such_job' });
  } finally {
    service.stop();
    rmSync(folder, { recursive: true, maxRetries: 20 });
  }
});
