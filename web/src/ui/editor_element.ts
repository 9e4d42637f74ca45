/**
 * `<darn-editor>`: the whole editor, as it is served at `/`, for any page.
 *
 * - `base-url`: the address of the service, ending in `/`; by default the one that this module was loaded from. It is read once, before
 *   the first scan is opened.
 * - `src`: the address of the scan to open.
 * - `key`: the key of a service that takes keys. Without it a person is asked for one when the service refuses a request, and it is kept as long
 *   as the tab is open.
 *
 * It emits `opened`, `mended`, `edited` and `saved`, which bubble out of shadow trees. The detail of `mended` and `edited` has the report
 * and the constraints, that of `saved` the file; a listener that prevents the default of `saved` keeps the page from downloading it.
 */
import { withoutLastCorner } from '../model/draft.js';
import { Editor } from '../model/editor.js';
import { type SavedLook, withLook } from '../model/saved_look.js';
import { scanBaseName, scanOf } from '../model/scan_files.js';
import { Service } from '../client.js';
import { FIRST_LOOK, type Look } from '../scene/viewer.js';
import { type TemplateResult, LitElement, css, html, nothing } from '../vendor.js';
import { download } from './download.js';
import './chart_panel.js';
import './constraints_panel.js';
import './holes_panel.js';
import { type KeyDialog, TabKeys } from './key_dialog.js';
import './look_panel.js';
import './report_panel.js';
import './save_panel.js';
import './stage.js';
import type { Stage } from './stage.js';
import { shared } from './styles.js';
import { TOOLS, needsCloth } from './tools_panel.js';
import { welcome } from './welcome.js';

export class EditorElement extends LitElement {
  static override styles = [
    shared,
    css`
      :host {
        display: grid;
        grid-template: auto 1fr / 1fr 340px;
        height: 100%;
        background: var(--surface);
      }
      header {
        grid-column: 1 / -1;
        display: flex;
        flex-wrap: wrap;
        gap: 6px;
        align-items: center;
        padding: 6px 10px;
        border-bottom: 1px solid var(--line);
      }
      h1 {
        margin: 0 0.75rem 0 0;
        font-size: 1.05rem;
      }
      .name {
        flex: 1;
        min-width: 3rem;
        overflow: hidden;
        text-overflow: ellipsis;
        white-space: nowrap;
      }
      main {
        position: relative;
        min-height: 0;
      }
      darn-stage {
        height: 100%;
      }
      aside {
        overflow: auto;
        padding: 12px;
        border-left: 1px solid var(--line);
        background: var(--raised);
      }
      aside > * {
        display: block;
        margin-bottom: 1.25rem;
      }
      .welcome {
        position: absolute;
        inset: 0;
        display: flex;
        flex-direction: column;
        align-items: center;
        justify-content: center;
        gap: 12px;
        text-align: center;
        padding: 1rem;
      }
      .welcome p {
        max-width: 34rem;
        margin: 0;
      }
      .over {
        outline: 4px dashed var(--accent);
        outline-offset: -10px;
      }
      .notice {
        position: absolute;
        left: 12px;
        right: 12px;
        bottom: 12px;
        padding: 8px 12px;
        border: 1px solid var(--line);
        border-radius: 6px;
        background: var(--surface);
      }
      .problem {
        border-color: var(--error);
        background: var(--error-surface);
        color: var(--error);
      }
      .problem p {
        white-space: pre-line;
      }
      .said {
        position: absolute;
        left: 12px;
        bottom: 12px;
        max-width: calc(100% - 24px);
        box-sizing: border-box;
        padding: 3px 10px;
        border: 1px solid var(--line);
        border-radius: 6px;
        background: var(--surface);
        font-size: 12px;
        pointer-events: none;
      }
      progress {
        width: 100%;
        height: 8px;
        accent-color: var(--accent);
      }
      .hidden {
        position: absolute;
        width: 1px;
        height: 1px;
        overflow: hidden;
        clip-path: inset(50%);
      }
      @media (max-width: 720px) {
        /* Beside the button before it, so that the others are in a row of their own. */
        .name {
          min-width: calc(100% - 185px);
        }
        #undo {
          margin-left: auto;
        }
        #another {
          display: none;
        }
        :host {
          grid-template: auto 55% 1fr / 1fr;
        }
        aside {
          border-left: 0;
          border-top: 1px solid var(--line);
        }
      }
    `,
  ];

  static override properties = { src: {}, key: {}, baseUrl: { attribute: 'base-url' } };

  declare src: string | undefined;
  declare key: string | undefined;
  declare baseUrl: string | undefined;
  private dragging = false;
  /** The look that was chosen. */
  private shown = FIRST_LOOK;
  private savedLook: SavedLook = 'blended';
  private made: Editor | undefined;

  constructor() {
    super();
    this.addEventListener('dragover', this.dragOver);
    this.addEventListener('dragleave', this.dragLeave);
    this.addEventListener('drop', this.drop);
  }

  /** The editor, made when it is needed first: then the properties are known. */
  get editor(): Editor {
    this.made ??= this.makeEditor();
    return this.made;
  }

  private makeEditor(): Editor {
    const keys = new TabKeys(this.base);
    const askForKey = async (): Promise<string | undefined> => {
      await this.updateComplete;
      const given = await this.keyDialog?.ask();
      keys.keep(given);
      return given;
    };
    const service = new Service(this.base, { key: this.key ?? keys.kept, askForKey });
    const editor = new Editor(service);
    editor.addEventListener('change', () => this.requestUpdate());
    editor.addEventListener('opened', () => {
      // Of another scan all is seen: new cloth on the side of before would look as if it was missing.
      this.change({ split: 0 });
      this.emit('opened', { name: editor.scan?.name });
    });
    for (const name of ['mended', 'edited']) {
      editor.addEventListener(name, () => {
        const { report, constraints } = editor.step;
        this.emit(name, { report, constraints });
      });
    }
    return editor;
  }

  /** The address of the service. */
  private get base(): URL {
    return new URL(this.baseUrl ?? new URL('..', import.meta.url), document.baseURI);
  }

  override connectedCallback(): void {
    super.connectedCallback();
    addEventListener('keydown', this.keyDown);
    addEventListener('keyup', this.keyUp);
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    removeEventListener('keydown', this.keyDown);
    removeEventListener('keyup', this.keyUp);
  }

  protected override willUpdate(changed: Map<PropertyKey, unknown>): void {
    const { src } = this;
    if (!changed.has('src') || src === undefined) {
      return;
    }
    try {
      void this.editor.openAddress(new URL(src, document.baseURI));
    } catch {
      this.editor.report(new Error(`${src} is not an address.`));
    }
  }

  /** Tells the page something. Whether the page left the default to the editor. */
  private emit(name: string, detail: object): boolean {
    return this.dispatchEvent(new CustomEvent(name, { detail, bubbles: true, composed: true, cancelable: true }));
  }

  protected override render(): TemplateResult {
    const { editor } = this;
    const { scan, work } = editor;
    return html`
      <header>
        <h1>darn</h1>
        <button @click=${this.pick}>Open a scan</button>
        <button id="another" @click=${this.openExample} ?hidden=${scan === undefined}>Open the example</button>
        <span class="quiet name" title=${scan?.name ?? ''}>${scan?.name ?? ''}</span>
        <button
          id="undo"
          ?disabled=${editor.undoLabel === undefined || work !== undefined}
          title=${editor.undoLabel ? `Undo: ${editor.undoLabel} (Ctrl+Z)` : 'Nothing to undo'}
          @click=${() => editor.undo()}
        >
          Undo
        </button>
        <button
          id="redo"
          ?disabled=${editor.redoLabel === undefined || work !== undefined}
          title=${editor.redoLabel ? `Redo: ${editor.redoLabel} (Ctrl+Shift+Z)` : 'Nothing to redo'}
          @click=${() => editor.redo()}
        >
          Redo
        </button>
        <button
          id="save"
          class="main"
          ?disabled=${editor.step.holes.length === 0 || work !== undefined}
          @click=${this.save}
        >
          Save the scan
        </button>
        <input
          id="file"
          type="file"
          accept=".glb,.gltf,.bin,.png,.jpg,.jpeg,.webp"
          multiple
          hidden
          @change=${this.picked}
        />
      </header>
      <main class=${this.dragging ? 'over' : ''}>
        <darn-stage .editor=${editor}></darn-stage>
        ${scan === undefined && work === undefined ? welcome(this.pick, this.openExample) : nothing} ${this.notices()}
        ${this.said()}
      </main>
      <aside
        @darn-frame=${this.frame}
        @darn-look=${this.look}
        @darn-saved-look=${this.chooseSavedLook}
        @darn-picture=${this.savePicture}
      >
        ${
          scan === undefined
            ? html`<p class="quiet">The holes of the scan will be listed here.</p>`
            : html`
                <darn-holes .editor=${editor}></darn-holes>
                <darn-tools .editor=${editor}></darn-tools>
                <darn-chart .editor=${editor}></darn-chart>
                <darn-look .editor=${editor} .shown=${this.shown}></darn-look>
                <darn-save .editor=${editor} .look=${this.savedLook}></darn-save>
                <darn-report .editor=${editor}></darn-report>
                <darn-constraints .editor=${editor}></darn-constraints>
              `
        }
      </aside>
      <darn-key></darn-key>
    `;
  }

  /** The last result, or what can be done next; what is under way is seen as a notice already. */
  private said(): TemplateResult {
    const { work, problem, message } = this.editor;
    const isSeen = work === undefined && problem === undefined && message !== '';
    return html`
      <div class=${isSeen ? 'said' : 'hidden'} role="status" aria-live="polite">${work?.label ?? message}</div>
    `;
  }

  private notices(): TemplateResult | typeof nothing {
    const { work, problem } = this.editor;
    if (problem !== undefined) {
      return html`
        <div class="notice problem" role="alert">
          <p>${problem}</p>
          <button @click=${() => this.editor.clearProblem()}>Close</button>
        </div>
      `;
    }
    if (work === undefined) {
      return nothing;
    }
    return html`
      <div class="notice">
        <div class="row">
          ${work.label} …
          <button @click=${() => work.stop.abort()}>Stop</button>
        </div>
        <progress aria-label=${work.label} value=${work.share ?? nothing}></progress>
      </div>
    `;
  }

  private get keyDialog(): KeyDialog | null {
    return this.renderRoot.querySelector<KeyDialog>('darn-key');
  }

  private get stage(): Stage | null {
    return this.renderRoot.querySelector<Stage>('darn-stage');
  }

  private readonly pick = (): void => this.renderRoot.querySelector<HTMLInputElement>('#file')?.click();

  private readonly picked = (event: Event): void => {
    const input = event.target as HTMLInputElement;
    void this.openFiles([...(input.files ?? [])]);
    // So that the same file can be picked again.
    input.value = '';
  };

  private async openFiles(files: readonly File[]): Promise<void> {
    try {
      const scan = await scanOf(files);
      if (scan !== undefined) {
        await this.editor.open(scan.file, scan.name);
      }
    } catch (error) {
      this.editor.report(error);
    }
  }

  private readonly openExample = (): void => {
    void this.editor.openAddress(new URL('editor/scarf_hole.glb', this.base));
  };

  private readonly save = async (): Promise<void> => {
    const result = await this.editor.result();
    if (result !== undefined) {
      const file = await withLook(result, this.savedLook);
      const opened = this.editor.scan?.name ?? 'scan.glb';
      const name = opened.replace(/(\.[a-z]+)?$/i, (ending) => `.mended${ending || '.glb'}`);
      if (this.emit('saved', { file, name })) {
        download(file, name);
      }
    }
  };

  private readonly chooseSavedLook = ({ detail }: CustomEvent<SavedLook>): void => {
    this.savedLook = detail;
    this.requestUpdate();
  };

  private readonly savePicture = async (): Promise<void> => {
    const picture = await this.stage?.viewer?.picture();
    if (picture !== undefined) {
      download(picture, `${scanBaseName(this.editor.scan?.name)}.png`);
      this.editor.say('The picture is saved.');
    }
  };

  private readonly dragOver = (event: DragEvent): void => {
    event.preventDefault();
    this.setDragging(true);
  };

  private readonly dragLeave = (): void => this.setDragging(false);

  private readonly drop = (event: DragEvent): void => {
    event.preventDefault();
    this.setDragging(false);
    void this.openFiles([...(event.dataTransfer?.files ?? [])]);
  };

  private setDragging(dragging: boolean): void {
    this.dragging = dragging;
    this.requestUpdate();
  }

  private readonly frame = (event: CustomEvent<number>): void => this.stage?.viewer?.frame(event.detail);

  private readonly look = (event: CustomEvent<Partial<Look>>): void => this.change(event.detail);

  private change(look: Partial<Look>): void {
    this.shown = { ...this.shown, ...look };
    this.stage?.viewer?.setLook(look);
    this.requestUpdate();
  }

  private readonly keyDown = (event: KeyboardEvent): void => {
    if (!this.isMeant(event)) {
      return;
    }
    const key = event.key.toLowerCase();
    if ((event.ctrlKey || event.metaKey) && (key === 'z' || key === 'y') && !isTyping(event)) {
      event.preventDefault();
      if (key === 'y' || event.shiftKey) {
        this.editor.redo();
      } else {
        this.editor.undo();
      }
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event)) {
      return;
    }
    const tool = TOOLS.find((it) => it.key.toLowerCase() === key)?.tool;
    const usable = this.editor.scan !== undefined && (this.editor.editable.length > 0 || !needsCloth(tool ?? 'look'));
    if (tool !== undefined && usable) {
      this.editor.setTool(tool);
    } else if (key === 'backspace' && this.editor.draft?.kind === 'polygon') {
      this.editor.preview(withoutLastCorner(this.editor.draft));
    } else if (key === 'f') {
      this.stage?.viewer?.frame();
    } else if (key === 'b') {
      this.stage?.viewer?.setLook({ before: true });
    }
  };

  /** Whether a key is for the editor: pressed in it, or nowhere in particular. */
  private isMeant(event: KeyboardEvent): boolean {
    const path = event.composedPath();
    return path.includes(this) || path[0] === document.body;
  }

  private readonly keyUp = (event: KeyboardEvent): void => {
    if (event.key.toLowerCase() === 'b') {
      this.stage?.viewer?.setLook({ before: false });
    }
  };
}

/** Whether a key goes into a field. */
function isTyping(event: KeyboardEvent): boolean {
  const target = event.composedPath()[0];
  return (
    target instanceof HTMLTextAreaElement ||
    (target instanceof HTMLInputElement && !['checkbox', 'radio', 'range', 'button'].includes(target.type))
  );
}

customElements.define('darn-editor', EditorElement);
