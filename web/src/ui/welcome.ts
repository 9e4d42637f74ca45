/** What stands in place of the picture while no scan is open. */
import { type TemplateResult, html } from '../vendor.js';

export function welcome(open: () => void, openExample: () => void): TemplateResult {
  return html`
    <div class="welcome">
      <h2>Mend a scan of cloth</h2>
      <p>
        Drop a glTF file here: a GLB, or a glTF together with the files that it refers to. The service finds its holes
        and fills them with cloth that continues the folds around them. The scan itself stays as it is.
      </p>
      <div class="row">
        <button class="main" @click=${open}>Open a scan</button>
        <button id="example" @click=${openExample}>Try the example</button>
      </div>
    </div>
  `;
}
