// Serves dist/ as it is now, and everything else from a running darn: the page can be changed without building the program.
//
//   node dev.mjs [PORT] [URL OF DARN]

import { createReadStream, existsSync } from 'node:fs';
import { createServer, request } from 'node:http';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const port = Number(process.argv[2] ?? 8090);
const service = new URL(process.argv[3] ?? 'http://127.0.0.1:8080');
const dist = join(dirname(fileURLToPath(import.meta.url)), 'dist');
const types = { html: 'text/html', js: 'text/javascript', css: 'text/css', svg: 'image/svg+xml' };

const server = createServer((incoming, answer) => {
  const path = incoming.url === '/' ? '/index.html' : incoming.url;
  const file = join(dist, path);
  const own = incoming.method === 'GET' && file.startsWith(dist) && existsSync(file);
  // Asked for in any case: the answer has the headers of the service, such as its content security policy.
  const options = { method: incoming.method, headers: own ? { host: service.host } : incoming.headers };
  const outgoing = request(new URL(incoming.url, service), options, (response) => {
    if (own) {
      const { 'content-security-policy': policy = '' } = response.headers;
      const type = types[path.split('.').pop()];
      answer.writeHead(200, { 'content-type': `${type}; charset=utf-8`, 'content-security-policy': policy });
      createReadStream(file).pipe(answer);
      response.resume();
    } else {
      answer.writeHead(response.statusCode, response.headers);
      response.pipe(answer);
    }
  });
  outgoing.on('error', (error) => answer.writeHead(502).end(String(error)));
  incoming.pipe(outgoing);
});
server.listen(port, '127.0.0.1', () => console.log(`http://127.0.0.1:${port}/`));
