/** The service's own page: `#scan=URL` opens the scan at an address. */
import './main.js';

function openNamed(): void {
  const named = new URLSearchParams(location.hash.slice(1)).get('scan');
  if (named !== null) {
    document.querySelector('darn-editor')?.setAttribute('src', named);
  }
}

addEventListener('hashchange', openNamed);
openNamed();
