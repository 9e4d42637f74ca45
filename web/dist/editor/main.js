var y=class extends Error{constructor(t,r,n,o){super(n);this.status=t;this.code=r;this.retryAfter=o}status;code;retryAfter;name="ProblemError";get sessionIsGone(){return this.status===410||this.code==="session_not_found"}};function W(s,e,t){let r=Number(e??Number.NaN),n=Number.isFinite(r)&&r>=0?r:void 0;try{let o=JSON.parse(t),i=(o.errors??[]).map(a=>`
${a.pointer??""} ${a.detail}`);return new y(s,o.code,o.detail+i.join(""),n)}catch{return new y(s,"",`The service answered with status ${s}.`,n)}}function se(s){return s instanceof y?oe(s.message):s instanceof TypeError&&/fetch|network/i.test(s.message)?"The service cannot be reached.":oe(s instanceof Error?s.message:String(s))}function ie(s){return s instanceof DOMException&&s.name==="AbortError"}function oe(s){let e=s.charAt(0).toUpperCase()+s.slice(1);return/[.!?]$/.test(e)?e:`${e}.`}var ae={anchors:[],edits:[]};function G(s,e){return"edit"in e?{...s,edits:[...s.edits,e.edit]}:{...s,anchors:[...s.anchors,e.anchor]}}function de(s,e){let t=r=>r.hole===void 0||e.has(r.hole);return{anchors:s.anchors.filter(t),edits:s.edits.filter(t)}}function k(s){return{...s.anchors.length>0&&{anchors:[...s.anchors]},...s.edits.length>0&&{edits:[...s.edits]}}}function ce(s,e){return{holes:s.map(t=>({id:t})),...k(e)}}function le(s){let e;try{e=JSON.parse(s)}catch(a){throw new Error(`The constraints are not JSON: ${a instanceof Error?a.message:String(a)}`)}if(typeof e!="object"||e===null||Array.isArray(e))throw new Error("The constraints must be a JSON object.");let{holes:t,anchors:r=[],edits:n=[],...o}=e,i=Object.keys(o);if(i.length>0)throw new Error(`The editor does not use: ${i.join(", ")}.`);if(!_(r)||!_(n))throw new Error("`anchors` and `edits` must be lists of objects.");return{holes:t===void 0?void 0:Ue(t),constraints:{anchors:r,edits:n}}}function Ue(s){if(!_(s))throw new Error("`holes` must be a list of objects.");return s.map(e=>{let t=e.id;if(typeof t!="number"||!Number.isInteger(t))throw new Error("The editor reads holes by `id` alone.");return t})}function _(s){return Array.isArray(s)&&s.every(e=>typeof e=="object"&&e!==null)}var A=class{states;at=0;constructor(e){this.states=[e]}get present(){return this.states[this.at]}get canUndo(){return this.at>0}get canRedo(){return this.at+1<this.states.length}get next(){return this.states[this.at+1]}push(e){this.states.length=this.at+1,this.states.push(e),this.at+=1}undo(){this.at=Math.max(this.at-1,0)}redo(){this.at=Math.min(this.at+1,this.states.length-1)}};var T=class{running;waiting;offer(e){if(this.running!==void 0){this.waiting=e;return}this.running=this.run(e)}async settled(){this.waiting=void 0,await this.running}async run(e){for(let t=e;t!==void 0;)await t(),t=this.waiting,this.waiting=void 0;this.running=void 0}};var he=new Map([["HOLE",{plural:"Holes",singular:"Hole",color:"#d9480f",line:"solid"}],["TUBE_END",{plural:"Ends of sleeves",singular:"End of a sleeve",color:"#2b8a3e",line:"dotted"}],["OUTER_BOUNDARY",{plural:"Borders",singular:"Border",color:"#1864ab",line:"dashed"}]]);function S(s){let e=s.toLowerCase().replaceAll("_"," "),t=e.charAt(0).toUpperCase()+e.slice(1);return he.get(s)??{plural:t,singular:t,color:"#862e9c",line:"dotted"}}function v(s){return s.kind==="HOLE"}function R(s){let e=[...he.keys()],t=new Map(e.map(n=>[n,[]]));for(let n of s){let o=n.kind??"LOOP_KIND_UNSPECIFIED";t.set(o,[...t.get(o)??[],n])}let r=n=>n.length??0;return[...t].filter(([,n])=>n.length>0).map(([n,o])=>[n,o.sort((i,a)=>r(a)-r(i))])}function b(s){return s===void 0||!Number.isFinite(s)?"\u2013":s!==0&&(Math.abs(s)>=1e6||Math.abs(s)<.001)?s.toExponential(2):String(Number(s.toPrecision(3)))}var O=class{constructor(e,t){this.service=e;this.scan=t}service;scan;opened;get skipped(){return this.opened?.session.skipped??[]}mend(e,t,r){return this.within(e,r,async n=>{let{positions:o,report:i}=await this.service.mend(n.id,t,r);return n.met=JSON.stringify(t),{patches:pe(n,o),report:i}})}preview(e,t){return this.within(e,{},async r=>{let n=await this.service.positions(r.id,t,{});return r.met=JSON.stringify(t),pe(r,n)})}optimizeAnchor(e,t,r){return this.within(e,r,({id:n})=>this.service.optimizeAnchor(n,t,r))}result(e,t,r){return this.within(e,r,async n=>(n.met!==JSON.stringify(t)&&(await this.service.mend(n.id,t,r),n.met=JSON.stringify(t)),this.service.result(n.id,r)))}close(){this.opened!==void 0&&(this.service.close(this.opened.id),this.opened=void 0)}async within(e,t,r){try{return await r(await this.open(e,t))}catch(n){if(!(n instanceof y&&n.sessionIsGone))throw n;return this.opened=void 0,r(await this.open(e,t))}}async open(e,t){let r=e.join();if(this.opened?.asked===r)return this.opened;let n={holes:e.map(l=>({id:l}))},o=await this.service.openSession(this.scan,n,t),i=o.id??"",a=await this.service.positions(i,{},t),d=await this.service.patches(i,{},t),c=new Map(ue(o,a).map(({hole:l,positions:p})=>[l.id??0,p]));return this.close(),this.opened={id:i,asked:r,session:o,dressing:{glb:d,positions:c},met:void 0},this.opened}};function pe({session:s,dressing:e},t){return ue(s,t).map(r=>({...r,dressing:e}))}function ue(s,e){let t=0;return(s.holes??[]).map(r=>{let n=t+(r.patchUvs?.length??0)/2*3,o=e.subarray(t,n);return t=n,{hole:r,positions:o}})}var fe={label:"Open",holes:[],constraints:ae,patches:[],report:void 0},C=class extends EventTarget{constructor(t){super();this.service=t;this.limits=t.info().catch(()=>{})}service;scan;chosen=new Set;skipped=[];tool="look";draft;draftPatches;found;work;problem;message="";history=new A(fe);session;live=new T;limits;get step(){return this.history.present}get patches(){return this.draftPatches??this.step.patches}get undoLabel(){return this.history.canUndo?this.history.present.label:void 0}get redoLabel(){return this.history.next?.label}reportOf(t){return this.step.report?.holes?.find(r=>r.id===t)}async open(t,r){await this.working(`Sending ${r}`,async n=>{let o=(await this.limits)?.limits.bodyBytes;if(o!==void 0&&t.size+4096>o)throw new Error(`${r} has ${t.size} bytes; this service takes at most ${o}.`);let i=await t.arrayBuffer(),{loops:a=[],notes:d=[]}=await this.service.holes(t,n);this.session?.close(),this.session=new O(this.service,t),this.scan={file:t,name:r,bytes:i,loops:a,notes:d},this.history=new A(fe),this.chosen=new Set(a.filter(v).map(l=>l.id??0)),this.skipped=[],this.found=void 0,this.dropDraft();let c=this.chosen.size;this.message=`${r} is open: ${c} ${c===1?"hole":"holes"} in ${a.length} boundary loops.`,this.dispatchEvent(new Event("opened"))})}async openAddress(t){let r=decodeURIComponent(t.pathname.split("/").pop()??"")||t.host,n;await this.working(`Loading ${r}`,async({signal:o})=>{let i=await fetch(t,{signal:o??null});if(!i.ok)throw new Error(`${t.href} answered with status ${i.status}.`);n=new Blob([await i.arrayBuffer()],{type:"model/gltf-binary"})}),n!==void 0&&await this.open(n,r)}choose(t){this.chosen=t,this.changed()}async mend(){let t=[...this.chosen].sort((n,o)=>n-o),r=`${t.length} ${t.length===1?"hole":"holes"}`;await this.apply(`Mend ${r}`,t,de(this.step.constraints,this.chosen))}preview(t){this.draft=t,this.changed(),this.live.offer(async()=>{let{step:r,session:n}=this;if(!(this.draft!==t||n===void 0))try{let o=G(r.constraints,t),i=await n.preview(r.holes,k(o));this.draft!==void 0&&this.step===r&&(this.draftPatches=i,this.changed())}catch(o){this.report(o)}})}async commit(t){let{draft:r}=this;r!==void 0&&(await this.live.settled(),await this.apply(t,this.step.holes,G(this.step.constraints,r)))}dropDraft(){this.draft=void 0,this.draftPatches=void 0,this.changed()}async findAnchor(t,r,n){let o;return await this.working("Searching",async i=>{let a=await this.session?.optimizeAnchor(this.step.holes,{hole:t,target:[...r],map:n},i);a!==void 0&&(o={hole:t,found:a},this.found=o,this.message=`Found after ${a.evaluations} evaluations of the network.`)}),o}async addAnchor(t){this.draft={anchor:t},await this.commit(t.hard?"Hard anchor":"Anchor")}undo(){this.travel(()=>this.history.undo(),"Undone")}redo(){this.travel(()=>this.history.redo(),"Redone")}setTool(t){this.tool=t,this.dropDraft()}constraintsText(){let{holes:t,constraints:r}=this.step;return JSON.stringify(ce(t,r),void 0,2)}async loadConstraints(t){let r;try{r=le(t)}catch(d){this.report(d);return}let{scan:n,step:o}=this,i=(n?.loops??[]).filter(v).map(d=>d.id??0),a=[...r.holes??(o.holes.length>0?o.holes:i)].sort((d,c)=>d-c);await this.apply("Load constraints",a,r.constraints),this.choose(new Set(this.step.holes))}async result(){let t;return await this.working("Saving",async r=>{let{holes:n,constraints:o}=this.step;t=await this.session?.result(n,k(o),r),this.message=`Saved with ${n.length} filled ${n.length===1?"hole":"holes"}.`}),t}report(t){ie(t)||(this.problem=se(t),this.changed())}clearProblem(){this.problem=void 0,this.changed()}async apply(t,r,n){await this.working(t,async o=>{if(this.session===void 0||r.length===0)return;let{patches:i,report:a}=await this.session.mend(r,k(n),o);this.skipped=this.session.skipped;let d=i.map(c=>c.hole.id??0);this.history.push({label:t,holes:d,constraints:n,patches:i,report:a}),this.message=this.messageOfStep(t,this.history.present)}),this.dropDraft()}messageOfStep(t,r){let n=r.patches.reduce((o,i)=>o+(i.hole.patchFaces?.length??0)/3,0);return`${t}: ${r.patches.length} filled, ${n.toLocaleString("en")} new triangles.`}travel(t,r){let n=this.step;t(),this.step!==n&&(this.message=`${r}. Now: ${this.step.label}.`,this.found=void 0,this.problem=void 0),this.dropDraft()}async working(t,r){this.work?.stop.abort();let n=new AbortController,o=(i,a)=>{n.signal.aborted||(this.work={label:i,share:a,stop:n},this.changed())};this.problem=void 0,o(t,void 0);try{await r({signal:n.signal,onSent:i=>o(i<1?t:"Computing",i<1?i:void 0),onWait:i=>o(`The service is busy; waiting ${i} s`,void 0)})}catch(i){this.report(i)}finally{this.work?.stop===n&&(this.work=void 0),this.changed()}}changed(){this.dispatchEvent(new Event("change"))}};function me(s,e){let t=/boundary="?([^";]+)"?/.exec(s)?.[1];if(!s.startsWith("multipart/mixed")||t===void 0)throw new Error(`multipart/mixed was asked for, ${s} was answered`);let r=new Uint8Array(e),n=new Map,o=0;for(;;){let i=Ie(r,`\r
\r
`,o);if(i<0)return n;let a=new TextDecoder().decode(r.subarray(o,i)).toLowerCase(),d=Number(/content-length: *(\d+)/.exec(a)?.[1]??Number.NaN),c=/name="([^"]*)"/.exec(a)?.[1],l=i+4;if(!a.includes(`--${t.toLowerCase()}`)||c===void 0||!(l+d<=r.length))throw new Error("a part of a multipart/mixed answer cannot be read");let p=/content-type: *([^\r\n;]+)/.exec(a)?.[1]??"";n.set(c,{mediaType:p,body:r.slice(l,l+d)}),o=l+d+2}}function Ie(s,e,t){let r=[...e].map(o=>o.charCodeAt(0)),n=s.length-r.length;for(let o=t;o<=n;o+=1)if(r.every((i,a)=>s[o+a]===i))return o;return-1}var De=5,Ve=60;function q(s,e,t={}){return ye(t,()=>je(s,e,t))}function L(s,e,t={}){return ye(t,async()=>{let r=await fetch(s,{...e,signal:t.signal??null});if(!r.ok)throw W(r.status,r.headers.get("retry-after"),await r.text());return{contentType:r.headers.get("content-type")??"",body:await r.arrayBuffer()}})}function P(s){return JSON.parse(new TextDecoder().decode(s.body))}async function ye(s,e){for(let t=1;;t+=1)try{return await e()}catch(r){let n=r instanceof y&&r.status===503?r.retryAfter:void 0;if(n===void 0||n>Ve||t===De)throw r;s.onWait?.(n),await He(n,s.signal)}}function He(s,e){return new Promise((t,r)=>{let n=setTimeout(t,s*1e3);e?.addEventListener("abort",()=>{clearTimeout(n),r(new DOMException("stopped","AbortError"))})})}function je(s,e,{onSent:t,signal:r}){return new Promise((n,o)=>{let i=new XMLHttpRequest;i.open("POST",s),i.responseType="arraybuffer",i.upload.onprogress=a=>{a.lengthComputable&&a.total>0&&t?.(a.loaded/a.total)},i.onload=()=>{let a=i.response;if(i.status<400)n({contentType:i.getResponseHeader("content-type")??"",body:a});else{let d=new TextDecoder().decode(a);o(W(i.status,i.getResponseHeader("retry-after"),d))}},i.onerror=()=>o(new Error("The service cannot be reached, or it closed the connection.")),i.onabort=()=>o(new DOMException("stopped","AbortError")),r?.addEventListener("abort",()=>i.abort()),i.send(e)})}var B=class{constructor(e){this.base=e}base;async info(){return P(await L(this.at("info"),{}))}async holes(e,t){let r=new FormData;return r.append("scan",e,"scan"),P(await q(this.at("holes"),r,t))}async openSession(e,t,r){let n=new FormData;return n.append("scan",e,"scan"),n.append("constraints",new Blob([JSON.stringify(t)],{type:"application/json"}),"constraints"),P(await q(this.at("sessions"),n,r))}async positions(e,t,r){let n=await this.inpaint(e,t,"application/octet-stream",r);return new Float32Array(n.body)}async mend(e,t,r){let o=await this.inpaint(e,t,"multipart/mixed, application/octet-stream;q=0.9",r),{report:i,patches:a}=ze(o);return{report:i,positions:new Float32Array(a.buffer)}}async patches(e,t,r){return(await this.inpaint(e,t,"model/gltf-binary",r)).body}async optimizeAnchor(e,t,r){return P(await L(this.at(`sessions/${e}/optimize-anchor`),be(t),r))}async result(e,t){let r=await L(this.at(`sessions/${e}/result`),{},t);return new Blob([r.body],{type:r.contentType})}close(e){fetch(this.at(`sessions/${e}`),{method:"DELETE",keepalive:!0}).catch(()=>{})}inpaint(e,t,r,n){let o=be(t);return o.headers={...o.headers,accept:r},L(this.at(`sessions/${e}/inpaint`),o,n)}at(e){return new URL(e,this.base)}};function be(s){return{method:"POST",headers:{"content-type":"application/json"},body:JSON.stringify(s)}}function ze(s){let e=me(s.contentType,s.body),[t,r]=[e.get("report"),e.get("patches")];if(t===void 0||r===void 0)throw new Error("the answer has no report or no patches");return{report:JSON.parse(new TextDecoder().decode(t.body)),patches:r.body}}import{LitElement as qt,css as Kt,html as x,nothing as Ne}from"./vendor.js";function N(s,e){let t=document.createElement("a");t.href=URL.createObjectURL(s),t.download=e,t.click(),setTimeout(()=>URL.revokeObjectURL(t.href),6e4)}import{css as Ge,html as g,nothing as ge,svg as qe}from"./vendor.js";import{LitElement as _e}from"./vendor.js";import{css as We}from"./vendor.js";var F=We`
  :host {
    --surface: #ffffff;
    --raised: #f4f5f7;
    --text: #1c2026;
    --quiet: #555e6b;
    --line: #c9ced6;
    --accent: #1b5fa8;
    --on-accent: #ffffff;
    --error: #a61b1b;
    --error-surface: #fdecea;
    color: var(--text);
    font:
      14px/1.45 system-ui,
      -apple-system,
      'Segoe UI',
      sans-serif;
  }
  @media (prefers-color-scheme: dark) {
    :host {
      --surface: #1b1f25;
      --raised: #262c35;
      --text: #eceff4;
      --quiet: #b0b8c4;
      --line: #454e5b;
      --accent: #8dbdf2;
      --on-accent: #10233a;
      --error: #ffb4ab;
      --error-surface: #4a1f1c;
    }
  }
  [hidden] {
    display: none !important;
  }
  h2,
  h3 {
    margin: 0 0 0.5rem;
    font-size: 1rem;
  }
  h3 {
    font-size: 0.875rem;
  }
  p {
    margin: 0 0 0.5rem;
  }
  button,
  input,
  select,
  textarea {
    box-sizing: border-box;
    min-height: 28px;
    border: 1px solid var(--line);
    border-radius: 5px;
    background: var(--surface);
    color: inherit;
    font: inherit;
  }
  button {
    padding: 2px 10px;
    cursor: pointer;
  }
  button:hover:enabled {
    border-color: var(--accent);
  }
  button:disabled {
    color: var(--quiet);
    cursor: default;
    opacity: 0.65;
  }
  button.main,
  button[aria-pressed='true'] {
    border-color: var(--accent);
    background: var(--accent);
    color: var(--on-accent);
  }
  input[type='checkbox'],
  input[type='radio'] {
    width: 24px;
    min-height: 24px;
    margin: 0;
    accent-color: var(--accent);
  }
  input[type='range'] {
    width: 100%;
    accent-color: var(--accent);
  }
  input[type='number'] {
    width: 100%;
    padding: 2px 6px;
  }
  textarea {
    width: 100%;
    font:
      12px/1.4 ui-monospace,
      monospace;
  }
  :focus-visible {
    outline: 2px solid var(--accent);
    outline-offset: 2px;
  }
  .row {
    display: flex;
    flex-wrap: wrap;
    gap: 6px;
    align-items: center;
  }
  .quiet {
    color: var(--quiet);
  }
  .small {
    font-size: 12px;
  }
`;var m=class extends _e{static styles=[F];editor;changed=()=>this.requestUpdate();connectedCallback(){super.connectedCallback(),this.editor.addEventListener("change",this.changed)}disconnectedCallback(){super.disconnectedCallback(),this.editor.removeEventListener("change",this.changed)}};var K=class extends m{static styles=[m.styles,Ge`
      ul {
        margin: 0 0 0.75rem;
        padding: 0;
        list-style: none;
        max-height: 14rem;
        overflow: auto;
      }
      li {
        display: grid;
        grid-template-columns: 28px 1fr auto;
        align-items: center;
        min-height: 28px;
      }
      li button {
        border-color: transparent;
        background: none;
        text-align: left;
      }
      .why {
        grid-column: 2 / -1;
        padding: 0 10px 4px;
      }
      svg {
        vertical-align: middle;
        margin-right: 6px;
      }
    `].flat();lastClicked;render(){let{scan:e,chosen:t,work:r}=this.editor,n=e?.loops??[],o=n.filter(v).map(i=>i.id??0);return g`
      <h2>Holes</h2>
      ${R(n).map(([i,a])=>this.group(i,a))}
      ${o.length===0?g`<p>This scan has no holes to fill.</p>`:ge}
      <div class="row">
        <button class="main" id="mend" ?disabled=${t.size===0||r!==void 0} @click=${this.mend}>
          Mend ${t.size===1?"1 hole":`${t.size} holes`}
        </button>
        <button ?disabled=${o.length===0} @click=${()=>this.editor.choose(new Set(o))}>All</button>
        <button ?disabled=${t.size===0} @click=${()=>this.editor.choose(new Set)}>None</button>
      </div>
    `}group(e,t){let r=S(e),n={solid:"",dashed:"7 4",dotted:"2 4"}[r.line],o=qe`<svg width="30" height="8" aria-hidden="true">
      <line x1="0" y1="4" x2="30" y2="4" stroke=${r.color} stroke-width="3" stroke-dasharray=${n} />
    </svg>`;return g`
      <h3>${o}${r.plural} (${t.length})</h3>
      <ul aria-label=${r.plural}>
        ${t.map(i=>this.item(i,t))}
      </ul>
    `}item(e,t){let r=e.id??0,{step:n,skipped:o,chosen:i}=this.editor,a=n.holes.includes(r),d=o.find(l=>l.id===r&&l.code!=="not_selected"),c=`${S(e.kind??"").singular} ${r}`;return g`
      <li>
        ${v(e)?g`<input
                type="checkbox"
                aria-label="Choose ${c}"
                .checked=${i.has(r)}
                @click=${l=>this.toggle(l,r,t)}
              />`:g`<span></span>`}
        <button @click=${()=>this.frame(r)} aria-label="Show ${c}, length ${b(e.length)}">
          ${c}${a?" \u2713 mended":""}
        </button>
        <span class="quiet small">${b(e.length)} · ${e.vertices} vertices</span>
        ${d?g`<span class="why quiet small">Left open: ${d.reason}.</span>`:ge}
      </li>
    `}toggle(e,t,r){let n=r.map(l=>l.id??0),o=new Set(this.editor.chosen),[i,a]=[n.indexOf(this.lastClicked??t),n.indexOf(t)],d=e.shiftKey&&i>=0?n.slice(Math.min(i,a),Math.max(i,a)+1):[t],c=e.target.checked;for(let l of d)c?o.add(l):o.delete(l);this.lastClicked=t,this.editor.choose(o)}frame(e){this.dispatchEvent(new CustomEvent("darn-frame",{detail:e,bubbles:!0,composed:!0}))}mend=()=>{this.editor.mend()}};customElements.define("darn-holes",K);import{css as Ke,html as ve}from"./vendor.js";var Je=[["textured","Textured"],["shaded","Shaded"],["wireframe","Wireframe"]],J=class extends m{static styles=[m.styles,Ke`
      fieldset {
        margin: 0 0 0.5rem;
        padding: 0;
        border: 0;
      }
      label {
        display: inline-flex;
        align-items: center;
        gap: 4px;
        min-height: 28px;
      }
      .compare {
        display: block;
      }
    `].flat();render(){return ve`
      <h2>Look</h2>
      <fieldset>
        <legend class="quiet small">Surface</legend>
        <div class="row">
          ${Je.map(([e,t])=>ve`
              <label>
                <input
                  type="radio"
                  name="shading"
                  ?checked=${e==="textured"}
                  @change=${()=>this.look({shading:e})}
                />${t}
              </label>
            `)}
        </div>
      </fieldset>
      <label>
        <input
          type="checkbox"
          checked
          @change=${e=>this.look({tinted:e.target.checked})}
        />
        New cloth in its own colour
      </label>
      <label class="compare">
        Before and after (hold B for before)
        <input
          type="range"
          min="0"
          max="1"
          step="0.01"
          value="0"
          @input=${e=>this.look({split:Number(e.target.value)})}
        />
      </label>
    `}look(e){this.dispatchEvent(new CustomEvent("darn-look",{detail:e,bubbles:!0,composed:!0}))}};customElements.define("darn-look",J);function we(s){let e=s.patch??{},t=(e.faces??0).toLocaleString("en"),r=[`Hole ${s.id}: ${t} new triangles, area ${b(e.area)}, on a rim of length ${b(s.length)}.`,`${Ye(e.stretchMean,e.stretchMax)} ${Qe(e.selfIntersections??0)}`,Xe(e.networkShare)];for(let n of s.anchors??[]){let o=n.beyondReach??0,i=o>0?`; ${b(o)} of that is beyond the cloth's reach`:"";r.push(`An anchor is ${b(n.distance)} away from the cloth${i}.`)}for(let n of s.edits??[])r.push(`A gesture is followed to within ${b(n.distance)}.`);return[...r,...s.notes??[]].filter(n=>n!=="")}function xe(s){let e=s.holes?.length??0,t=s.skipped?.length??0,r=t===1?"1 loop is":`${t} loops are`;return`${ke(e,"hole")} filled; ${r} left open.`}function Ye(s,e){return s===void 0||e===void 0?"":`Lengths differ from those of flat cloth by ${Y(s-1)} on average, ${Y(e-1)} at most.`}function Qe(s){return s===0?"No triangles cross.":`${ke(s,"pair")} of triangles cross.`}function Xe(s){return s===void 0?"":s>=.995?"The network predicts its folds.":`${Y(s)} of the network's folds, for the rest a fair surface.`}function Y(s){return`${Number((Math.abs(s)*100).toPrecision(2))} %`}function ke(s,e){return`${s} ${e}${s===1?"":"s"}`}import{css as Ze,html as w,nothing as et}from"./vendor.js";var Q=class extends m{static styles=[m.styles,Ze`
      .hole {
        margin-bottom: 0.75rem;
      }
      .hole p {
        margin: 0;
      }
    `].flat();render(){let{report:e}=this.editor.step,t=[...this.editor.scan?.notes??[],...e?.notes??[]];return e===void 0?t.length===0?et:w`<h2>Notes</h2>
            ${t.map(r=>w`<p>${r}</p>`)}`:w`
      <h2>Report</h2>
      <p>${xe(e)}</p>
      ${[...new Set(t)].map(r=>w`<p>${r}</p>`)}
      ${(e.holes??[]).map(r=>w`<div class="hole">${we(r).map(n=>w`<p>${n}</p>`)}</div>`)}
      <button
        @click=${()=>N(new Blob([JSON.stringify(e,void 0,2)]),`${this.baseName}.report.json`)}
      >
        Save the report
      </button>
    `}get baseName(){return(this.editor.scan?.name??"scan").replace(/\.(glb|gltf)$/i,"")}};customElements.define("darn-report",Q);import{Box3 as Bt,DirectionalLight as Nt,HemisphereLight as Ft,OrbitControls as Ut,PerspectiveCamera as It,Plane as Dt,Raycaster as Vt,Scene as Ht,Sphere as te,Vector2 as jt,Vector3 as $,WebGLRenderer as zt}from"./vendor.js";function Ae(s,e){let t=tt(s);return nt(rt(t,e,s.length/3)).map(r=>ot(s,r))}function tt(s){let e=s.length/3,t=Uint32Array.from({length:e},(i,a)=>a),r=(i,a)=>{for(let d=0;d<3;d+=1){let c=s[3*i+d]-s[3*a+d];if(c!==0)return c}return 0};t.sort((i,a)=>r(i,a)||i-a);let n=new Uint32Array(e),o=0;for(let[i,a]of t.entries())(i===0||r(a,o)!==0)&&(o=a),n[a]=o;return n}function rt(s,e,t){let r=new Float64Array(e.length),n=new Map,o=h=>s[e[h]],i=0,a=h=>{for(let u=0;u+2<e.length;u+=3){let[f,E,M]=[o(u),o(u+1),o(u+2)];f!==E&&E!==M&&M!==f&&(h(f,E),h(E,M),h(M,f))}},d=(h,u)=>Math.min(h,u)*t+Math.max(h,u);a((h,u)=>{r[i]=d(h,u),i+=1});let c=r.subarray(0,i).sort(),l=new Set;for(let h=0;h<i;h+=1)c[h]!==c[h-1]&&c[h]!==c[h+1]&&l.add(c[h]);a((h,u)=>{let f=d(h,u);l.has(f)&&n.set(f,[h,u])});let p=new Map;for(let[h,u]of n.values())p.set(h,[...p.get(h)??[],u]);return p}function nt(s){let e=[];for(let t of s.keys())for(;;){let r=[],n=t;for(;n!==void 0;){let o=s.get(n)?.pop();if(o===void 0)break;r.push(n),n=o}if(r.length===0)break;e.push(r)}return e.filter(t=>t.length>2)}function ot(s,e){let t=new Float32Array(e.flatMap(o=>[...s.subarray(3*o,3*o+3)])),r=[0,0,0],n=0;for(let o=0;o<e.length;o+=1){let i=t.subarray(3*o,3*o+3),a=3*((o+1)%e.length),d=t.subarray(a,a+3),c=Math.hypot(...[0,1,2].map(l=>d[l]-i[l]));n+=c;for(let l of[0,1,2])r[l]+=c*(i[l]+d[l])/2}for(let o of[0,1,2])r[o]/=n||1;return{points:t,centroid:r,length:n}}function Se(s,e){let t=new Set(e),r=new Map;for(let n of s){let{centroid:o=[],length:i=0}=n,a;for(let d of t){let l=(Math.hypot(...d.centroid.map((p,h)=>p-(o[h]??0)))+Math.abs(d.length-i))/(i||1);l<(a?.cost??.05)&&(a={line:d,cost:l})}a!==void 0&&(t.delete(a.line),r.set(n.id??0,a.line))}return r}import{BufferAttribute as st,BufferGeometry as it,Group as at,Line as Le,LineBasicMaterial as dt,LineLoop as ct,Mesh as Pe,MeshBasicMaterial as lt,SphereGeometry as ht,Vector3 as Ir}from"./vendor.js";var pt=7;var U=class{group=new at;ball=new ht(1,24,16);ballMaterial=new lt({color:750213,depthTest:!1,transparent:!0});lineMaterial=new dt({color:750213,depthTest:!1,transparent:!0});show({handles:e=[],tethers:t=[],ring:r=[]}){this.clear();for(let n of e){let o=new Pe(this.ball,this.ballMaterial);o.position.copy(n),this.group.add(o)}for(let n of t)this.group.add(new Le($e(n),this.lineMaterial));r.length>0&&this.group.add(new ct($e(r),this.lineMaterial)),this.group.children.forEach(n=>n.renderOrder=10)}clear(){for(let e of this.group.children)e instanceof Le&&e.geometry.dispose();this.group.clear()}fit(e,t){let r=2*Math.tan(e.fov*Math.PI/360)/Math.max(t,1);for(let n of this.group.children)n instanceof Pe&&n.scale.setScalar(pt*r*e.position.distanceTo(n.position))}};function $e(s){let e=new Float32Array(s.flatMap(t=>t.toArray()));return new it().setAttribute("position",new st(e,3))}import{GLTFLoader as At,Mesh as Re,MeshStandardMaterial as St,Triangle as Me,Vector3 as V}from"./vendor.js";import{Box3 as ut,BufferAttribute as ft,DoubleSide as mt,GLTFLoader as yt,Mesh as bt,MeshBVH as gt,MeshStandardMaterial as vt,Vector3 as Ee,acceleratedRaycast as wt}from"./vendor.js";var xt=12172998;function D(s,e){return new vt({color:s,roughness:.85,side:mt,wireframe:e==="wireframe"})}var I=class s{constructor(e){this.root=e;e.updateMatrixWorld(!0),e.traverse(t=>{t instanceof bt&&(this.own.set(t,t.material),t.raycast=wt)})}root;own=new Map;plain;static async load(e){let t=await new yt().parseAsync(e,"");return new s(t.scene)}get meshes(){return[...this.own.keys()]}get bounds(){return new ut().setFromObject(this.root)}setShading(e){this.plain?.dispose();let t=e==="textured"?void 0:D(xt,e);this.plain=t;for(let[r,n]of this.own)r.material=t??n}materialNear(e){let t,r=new Ee;for(let[n,o]of this.own){let i=n.geometry.getAttribute("position");for(let a=0;a<i.count;a+=1){let d=r.fromBufferAttribute(i,a).applyMatrix4(n.matrixWorld).distanceToSquared(e);d<(t?.distance??Number.POSITIVE_INFINITY)&&(t={distance:d,material:Array.isArray(o)?o[0]:o})}}return t?.material}boundaryLines(){let{positions:e,triangles:t}=this.triangles();return Ae(e,t)}pick(e){for(let t of this.own.keys())t.geometry.boundsTree??=new gt(t.geometry);return e.firstHitOnly=!0,e.intersectObjects(this.meshes,!1)[0]}dispose(){this.plain?.dispose();for(let[e,t]of this.own){e.geometry.dispose();for(let r of Array.isArray(t)?t:[t])kt(r)}}triangles(){let e=this.meshes.reduce((d,{geometry:c})=>d+c.getAttribute("position").count,0),t=this.meshes.reduce((d,{geometry:c})=>d+(c.index??c.getAttribute("position")).count,0),r=new Float32Array(3*e),n=new Uint32Array(t),o=new Ee,[i,a]=[0,0];for(let d of this.meshes){let c=d.geometry.getAttribute("position");for(let h=0;h<c.count;h+=1)o.fromBufferAttribute(c,h).applyMatrix4(d.matrixWorld),o.toArray(r,3*(i+h));let{index:l}=d.geometry,p=l?.count??c.count;for(let h=0;h<p;h+=1)n[a+h]=i+(l?.getX(h)??h);i+=c.count,a+=p}return{positions:r,triangles:n}}};function kt(s){for(let e of Object.values(s))typeof e=="object"&&e!==null&&"isTexture"in e&&e.dispose();s.dispose()}function X(s){return new ft(s,3)}async function Oe(s){let{scene:e}=await new At().parseAsync(s,"");e.updateMatrixWorld(!0);let t=[];return e.traverse(r=>{r instanceof Re&&t.push(r.geometry.applyMatrix4(r.matrixWorld))}),t}var H=class{constructor(e,t,r){this.patch=e;let n=e.hole.id??0,o=e.dressing.positions.get(n)??e.positions,i=t.getAttribute("position");this.rim=(e.hole.rimUvs?.length??0)/2,this.corners=Pt(i.array,o),this.firstNormals=new Float32Array(t.getAttribute("normal").array);let a=Te(o,e.hole.patchFaces??[]);this.sides=Float32Array.from(this.corners,(d,c)=>[0,1,2].reduce((p,h)=>p+(a[3*d+h]??0)*(this.firstNormals[3*c+h]??0),0)<0?-1:1),t.setAttribute("position",X(new Float32Array(3*this.corners.length))),t.setAttribute("normal",X(new Float32Array(3*this.corners.length))),this.mesh=new Re(t,r),this.mesh.name=`hole ${n}`,this.update(e)}patch;mesh;corners;rim;firstNormals;sides;get hole(){return this.patch.hole.id??0}get shown(){return this.patch}update(e){this.patch=e;let{geometry:t}=this.mesh,[r,n]=[t.getAttribute("position"),t.getAttribute("normal")],o=Te(e.positions,e.hole.patchFaces??[]);for(let[i,a]of this.corners.entries()){let d=this.sides[i];for(let c=0;c<3;c+=1){let l=3*i+c;r.array[l]=e.positions[3*a+c],n.array[l]=a<this.rim?this.firstNormals[l]:d*o[3*a+c]}}r.needsUpdate=!0,n.needsUpdate=!0,t.computeBoundingSphere(),t.computeBoundingBox()}pointOf(e){if(e.face===null||e.face===void 0)return;let t=[e.face.a,e.face.b,e.face.c].map(c=>this.corners[c]),[r,n,o]=t.map(c=>this.vertex(c)),i=Me.getBarycoord(e.point,r,n,o,new V)?.toArray();if(i===void 0)return;let a=this.patch.hole.patchUvs??[],d=[0,1].map(c=>t.reduce((l,p,h)=>l+i[h]*a[2*p+c],0));return this.at(d)}at(e){let{patchFaces:t=[],patchUvs:r=[]}=this.patch.hole,n=o=>[r[2*o],r[2*o+1]];for(let o=0;o+2<t.length;o+=3){let i=t.slice(o,o+3),a=Lt(e,i.map(n));if(a!==void 0)return{hole:this.hole,uv:e,face:o/3,weights:a,...this.located(i,a)}}}follow(e){let t=(this.patch.hole.patchFaces??[]).slice(3*e.face,3*e.face+3);return this.located(t,e.weights).position}dispose(){this.mesh.geometry.dispose()}located(e,t){let r=e.map(o=>this.vertex(o)),n=new V;return r.forEach((o,i)=>n.addScaledVector(o,t[i])),{position:n,normal:Me.getNormal(...r,new V)}}vertex(e){return new V().fromArray(this.patch.positions,3*e)}};function Lt([s,e],[t,r,n]){let o=(r[0]-t[0])*(n[1]-t[1])-(n[0]-t[0])*(r[1]-t[1]);if(o===0)return;let i=((s-t[0])*(n[1]-t[1])-(n[0]-t[0])*(e-t[1]))/o,a=((r[0]-t[0])*(e-t[1])-(s-t[0])*(r[1]-t[1]))/o,d=1-i-a,c=-1e-6;return d>=c&&i>=c&&a>=c?[d,i,a]:void 0}function Pt(s,e){let t=(n,o)=>n.subarray(3*o,3*o+3).join(),r=new Map;for(let n=0;n<e.length/3;n+=1)r.set(t(e,n),n);return Uint32Array.from({length:s.length/3},(n,o)=>r.get(t(s,o))??$t(e,s.subarray(3*o,3*o+3)))}function $t(s,e){let t={vertex:0,distance:Number.POSITIVE_INFINITY};for(let r=0;r<s.length/3;r+=1){let n=[0,1,2].reduce((o,i)=>o+(s[3*r+i]-e[i])**2,0);n<t.distance&&(t={vertex:r,distance:n})}return t.vertex}function Te(s,e){let t=new Float32Array(s.length),r=(n,o)=>s[3*n+o];for(let n=0;n+2<e.length;n+=3){let[o,i,a]=[e[n],e[n+1],e[n+2]],[d,c,l]=[r(i,0)-r(o,0),r(i,1)-r(o,1),r(i,2)-r(o,2)],[p,h,u]=[r(a,0)-r(o,0),r(a,1)-r(o,1),r(a,2)-r(o,2)];for(let f of[o,i,a])t[3*f]=t[3*f]+c*u-l*h,t[3*f+1]=t[3*f+1]+l*p-d*u,t[3*f+2]=t[3*f+2]+d*h-c*p}for(let n=0;n<t.length;n+=3){let o=Math.hypot(...t.subarray(n,n+3))||1;for(let i=0;i<3;i+=1)t[n+i]=t[n+i]/o}return t}var Ce=15770462;function Be(s){return s?.clone()??new St({color:12172998})}import{Box3 as Et,Group as Mt,Line2 as Tt,LineGeometry as Rt,LineMaterial as Ot,Vector3 as Z}from"./vendor.js";var ee={chosen:4,other:2},j=class{group=new Mt;lines=new Map;views=new Map;constructor(e,t,r){for(let n of e){let o=t.get(n.id??0);if(o===void 0)continue;let i=S(n.kind??""),a=r*(i.line==="dotted"?.003:.012),d=new Ot({color:i.color,linewidth:ee.other,dashed:i.line!=="solid",dashSize:a,gapSize:i.line==="dotted"?2*a:.7*a}),c=new Rt;c.setPositions([...o.points,...o.points.subarray(0,3)]);let l=new Tt(c,d);l.computeLineDistances(),this.lines.set(n.id??0,l),this.views.set(n.id??0,Ct(o,n.kind)),this.group.add(l)}}choose(e){for(let[t,r]of this.lines)r.material.linewidth=e.has(t)?ee.chosen:ee.other}viewOf(e){return this.views.get(e)}dispose(){for(let e of this.lines.values())e.geometry.dispose(),e.material.dispose()}};function Ct({points:s},e){let t=Array.from({length:s.length/3},(i,a)=>new Z().fromArray(s,3*a)),r=new Et().setFromPoints(t),n=r.getCenter(new Z),o=new Z;return t.forEach((i,a)=>{let d=t[(a+1)%t.length];o.add(i.clone().sub(n).cross(d.clone().sub(n)))}),{bounds:r,front:e==="HOLE"?o.negate().normalize():o.normalize()}}var Wt={shading:"textured",tinted:!0,before:!1,split:0},z=class{constructor(e){this.host=e;this.renderer=new zt({antialias:!0,alpha:!0}),this.renderer.setPixelRatio(Math.min(devicePixelRatio,2)),this.canvas.tabIndex=0,e.append(this.canvas),this.controls=new Ut(this.camera,this.canvas),this.controls.enableDamping=!1,this.controls.addEventListener("change",()=>this.draw());let t=new Nt(16777215,1.9);t.position.set(1,1.2,.9),this.camera.add(t),this.scene.add(this.camera,new Ft(16777215,9279397,1),this.marks.group),this.resized=new ResizeObserver(()=>this.resize()),this.resized.observe(e),this.canvas.addEventListener("webglcontextrestored",()=>this.draw()),this.resize()}host;camera=new It(35,1,.01,100);controls;marks=new U;renderer;scene=new Ht;raycaster=new Vt;resized;scan;rims;patches=[];look=Wt;sphere;frameAsked=0;get canvas(){return this.renderer.domElement}get rendererName(){let e=this.renderer.getContext(),t=e.getExtension("WEBGL_debug_renderer_info");return String(e.getParameter(t?.UNMASKED_RENDERER_WEBGL??e.RENDERER))}async showScan(e,t){let r=await I.load(e.slice(0));this.clear(),this.scan=r,this.scene.add(r.root);let n=r.bounds.getBoundingSphere(new te).radius||1;this.rims=new j(t,Se(t,r.boundaryLines()),n),this.scene.add(this.rims.group),r.setShading(this.look.shading);let o=R(t)[0]?.[1][0]?.id??0;this.lookAt(r.bounds,this.rims.viewOf(o)?.front??new $(.5,.5,1))}chooseLoops(e){this.rims?.choose(e),this.draw()}async showPatches(e){if(e.length===this.patches.length&&e.every((r,n)=>this.patches[n]?.shown.dressing===r.dressing))e.forEach((r,n)=>{this.patches[n]?.shown!==r&&this.patches[n]?.update(r)});else{let r=e[0]?.dressing,n=r===void 0?[]:await Oe(r.glb.slice(0));this.clearPatches(),this.patches=e.flatMap((o,i)=>{let a=n[i];return a===void 0?[]:[new H(o,a,this.materialOf(o))]}),this.scene.add(...this.patches.map(({mesh:o})=>o))}this.draw()}setLook(e){let t=this.look;if(this.look={...t,...e},t.shading!==this.look.shading&&this.scan?.setShading(this.look.shading),t.shading!==this.look.shading||t.tinted!==this.look.tinted)for(let r of this.patches)r.mesh.material.dispose(),r.mesh.material=this.materialOf(r.shown);this.draw()}frame(e){let t=e===void 0?void 0:this.rims?.viewOf(e);this.lookAt(t?.bounds??this.scan?.bounds??new Bt,t?.front??new $)}pivotAt(e){this.controls.target.copy(e),this.controls.update(),this.draw()}pick(e,t){this.aim(e,t);let r=this.look.before?[]:this.patches,n=this.raycaster.intersectObjects(r.map(({mesh:i})=>i),!1)[0],o=this.scan?.pick(this.raycaster);if(n!==void 0&&n.distance<=(o?.distance??Number.POSITIVE_INFINITY)){let i=this.patches.find(({mesh:a})=>a===n.object);return{position:n.point,cloth:i?.pointOf(n)}}return o&&{position:o.point,cloth:void 0}}onScreenPlane(e,t,r){this.aim(e,t);let n=new Dt().setFromNormalAndCoplanarPoint(this.camera.getWorldDirection(new $),r);return this.raycaster.ray.intersectPlane(n,new $)??void 0}onLine(e,t,r,n){this.aim(e,t);let{origin:o,direction:i}=this.raycaster.ray,a=r.clone().sub(o),d=n.dot(i),c=(d*i.dot(a)-n.dot(a))/Math.max(1-d*d,1e-6);return r.clone().addScaledVector(n,c)}patchOf(e){return this.patches.find(t=>t.hole===e)}draw(){this.frameAsked===0&&(this.frameAsked=requestAnimationFrame(()=>{this.frameAsked=0,this.drawNow()}))}dispose(){cancelAnimationFrame(this.frameAsked),this.clear(),this.resized.disconnect(),this.controls.dispose(),this.renderer.dispose(),this.canvas.remove()}drawNow(){this.fitDepth(),this.marks.fit(this.camera,this.host.clientHeight);let{clientWidth:e,clientHeight:t}=this.host,r=Math.round(this.look.split*e);this.renderer.setScissorTest(r>0),this.drawPart(r>0?[r,e-r]:[0,e],t,!this.look.before),r>0&&this.drawPart([0,r],t,!1)}drawPart([e,t],r,n){this.look.split>0&&this.renderer.setScissor(e,0,t,r),this.patches.forEach(({mesh:o})=>o.visible=n),this.renderer.render(this.scene,this.camera),this.patches.forEach(({mesh:o})=>o.visible=!0)}lookAt(e,t){let{center:r,radius:n}=e.getBoundingSphere(new te);if(e.isEmpty()||!(n>0))return;let o=Math.min(1,this.camera.aspect),i=1.1*n/Math.sin(this.camera.fov*Math.PI/360)/o,a=t.lengthSq()>0?t.clone():this.camera.position.clone().sub(this.controls.target);this.controls.target.copy(r),this.camera.position.copy(r).addScaledVector(a.normalize(),i),this.fitDepth(),this.controls.update(),this.draw()}aim(e,t){let{left:r,top:n,width:o,height:i}=this.canvas.getBoundingClientRect(),a=new jt((e-r)/o*2-1,1-(t-n)/i*2);this.camera.updateMatrixWorld(),this.raycaster.setFromCamera(a,this.camera)}materialOf({hole:e}){let{shading:t,tinted:r}=this.look;return r?D(Ce,t):t!=="textured"?D(12172998,t):Be(this.scan?.materialNear(new $().fromArray(e.rimPositions??[0,0,0])))}fitDepth(){if(this.scan!==void 0){this.sphere??=this.scan.bounds.getBoundingSphere(new te);let{center:e,radius:t}=this.sphere,r=this.camera.position.distanceTo(e);this.camera.far=r+4*t,this.camera.near=Math.max(r-4*t,this.camera.far/5e3),this.camera.updateProjectionMatrix()}}resize(){let{clientWidth:e,clientHeight:t}=this.host;e>0&&t>0&&(this.renderer.setSize(e,t),this.camera.aspect=e/t,this.camera.updateProjectionMatrix(),this.drawNow())}clear(){this.clearPatches(),this.marks.clear(),this.scan!==void 0&&(this.scene.remove(this.scan.root),this.scan.dispose()),this.rims!==void 0&&(this.scene.remove(this.rims.group),this.rims.dispose()),this.scan=void 0,this.rims=void 0,this.sphere=void 0}clearPatches(){for(let e of this.patches)this.scene.remove(e.mesh),e.mesh.material.dispose(),e.dispose();this.patches=[]}};import{css as _t,html as Gt}from"./vendor.js";var re=class extends m{static styles=[m.styles,_t`
      :host {
        display: block;
        position: relative;
        overflow: hidden;
        background: radial-gradient(circle at 50% 40%, var(--surface), var(--raised));
      }
      #host {
        position: absolute;
        inset: 0;
      }
      canvas {
        display: block;
        touch-action: none;
      }
      canvas:focus-visible {
        outline-offset: -3px;
      }
    `].flat();viewer;opened=()=>{this.show()};connectedCallback(){super.connectedCallback(),this.editor.addEventListener("opened",this.opened)}disconnectedCallback(){super.disconnectedCallback(),this.editor.removeEventListener("opened",this.opened),this.viewer?.dispose(),this.viewer=void 0}render(){return Gt`<div id="host"></div>`}firstUpdated(){let e=this.renderRoot.querySelector("#host");if(e===null)return;try{this.viewer=new z(e)}catch(r){this.editor.report(new Error(`This browser draws no 3-D pictures (WebGL 2): ${String(r)}`));return}let{canvas:t}=this.viewer;t.setAttribute("role","img"),t.setAttribute("aria-label","The scan. Drag to turn it, two fingers or the right button to move it, F to see all."),t.addEventListener("dblclick",r=>{let n=this.viewer?.pick(r.clientX,r.clientY);n!==void 0&&this.viewer?.pivotAt(n.position)})}updated(){this.viewer?.chooseLoops(this.editor.chosen),this.viewer?.showPatches(this.editor.patches)}async show(){let{scan:e}=this.editor;if(e!==void 0)try{await this.viewer?.showScan(e.bytes,e.loops),this.requestUpdate()}catch(t){this.editor.report(new Error(`The scan was read by the service, but cannot be drawn: ${String(t)}`))}}};customElements.define("darn-stage",re);var Jt=/\.(glb|gltf)$/i,ne=class extends qt{static styles=[F,Kt`
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
      header .space {
        flex: 1;
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
        white-space: pre-line;
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
        :host {
          grid-template: auto 55% 1fr / 1fr;
        }
        aside {
          border-left: 0;
          border-top: 1px solid var(--line);
        }
      }
    `];editor=new C(new B(new URL(".",document.baseURI)));dragging=!1;changed=()=>this.requestUpdate();connectedCallback(){super.connectedCallback(),this.editor.addEventListener("change",this.changed),addEventListener("dragover",this.dragOver),addEventListener("dragleave",this.dragLeave),addEventListener("drop",this.drop),addEventListener("keydown",this.keyDown),addEventListener("keyup",this.keyUp),addEventListener("hashchange",this.openNamed),this.openNamed()}disconnectedCallback(){super.disconnectedCallback(),this.editor.removeEventListener("change",this.changed),removeEventListener("dragover",this.dragOver),removeEventListener("dragleave",this.dragLeave),removeEventListener("drop",this.drop),removeEventListener("keydown",this.keyDown),removeEventListener("keyup",this.keyUp),removeEventListener("hashchange",this.openNamed)}render(){let{editor:e}=this,{scan:t,work:r}=e;return x`
      <header>
        <h1>darn</h1>
        <button @click=${this.pick}>Open a scan</button>
        <button @click=${this.openExample} ?hidden=${t===void 0}>Open the example</button>
        <span class="quiet">${t?.name??""}</span>
        <span class="space"></span>
        <button
          id="undo"
          ?disabled=${e.undoLabel===void 0||r!==void 0}
          title=${e.undoLabel?`Undo: ${e.undoLabel} (Ctrl+Z)`:"Nothing to undo"}
          @click=${()=>e.undo()}
        >
          Undo
        </button>
        <button
          id="redo"
          ?disabled=${e.redoLabel===void 0||r!==void 0}
          title=${e.redoLabel?`Redo: ${e.redoLabel} (Ctrl+Shift+Z)`:"Nothing to redo"}
          @click=${()=>e.redo()}
        >
          Redo
        </button>
        <button
          id="save"
          class="main"
          ?disabled=${e.step.holes.length===0||r!==void 0}
          @click=${this.save}
        >
          Save the scan
        </button>
        <input id="file" type="file" accept=".glb,.gltf" hidden @change=${this.picked} />
      </header>
      <main class=${this.dragging?"over":""}>
        <darn-stage .editor=${e}></darn-stage>
        ${t===void 0&&r===void 0?this.welcome():Ne} ${this.notices()}
      </main>
      <aside @darn-frame=${this.frame} @darn-look=${this.look}>
        ${t===void 0?x`<p class="quiet">The holes of the scan will be listed here.</p>`:x`
                <darn-holes .editor=${e}></darn-holes>
                <darn-look .editor=${e}></darn-look>
                <darn-report .editor=${e}></darn-report>
              `}
      </aside>
      <div class="hidden" role="status" aria-live="polite">${e.work?.label??e.message}</div>
    `}welcome(){return x`
      <div class="welcome">
        <h2>Mend a scan of cloth</h2>
        <p>
          Drop a glTF file here (GLB, or glTF with its data inside). The service finds its holes and fills them with
          cloth that continues the folds around them. The scan itself stays as it is.
        </p>
        <div class="row">
          <button class="main" @click=${this.pick}>Open a scan</button>
          <button id="example" @click=${this.openExample}>Try the example</button>
        </div>
      </div>
    `}notices(){let{work:e,problem:t}=this.editor;return t!==void 0?x`
        <div class="notice problem" role="alert">
          ${t}
          <button @click=${()=>this.editor.clearProblem()}>Close</button>
        </div>
      `:e===void 0?Ne:x`
      <div class="notice">
        <div class="row">
          ${e.label} …
          <button @click=${()=>e.stop.abort()}>Stop</button>
        </div>
        <progress
          aria-label=${e.label}
          .value=${e.share??0}
          ?indeterminate=${e.share===void 0}
        ></progress>
      </div>
    `}get stage(){return this.renderRoot.querySelector("darn-stage")}pick=()=>this.renderRoot.querySelector("#file")?.click();picked=e=>{let t=e.target;this.openFiles([...t.files??[]]),t.value=""};openFiles(e){let t=e.find(r=>Jt.test(r.name))??e[0];t!==void 0&&this.editor.open(t,t.name)}openExample=()=>{this.editor.openAddress(new URL("editor/scarf_hole.glb",document.baseURI))};openNamed=()=>{let e=new URLSearchParams(location.hash.slice(1)).get("scan");if(e!==null)try{this.editor.openAddress(new URL(e,document.baseURI))}catch{this.editor.report(new Error(`${e} is not an address.`))}};save=async()=>{let e=await this.editor.result();if(e!==void 0){let t=this.editor.scan?.name??"scan.glb";N(e,t.replace(/(\.[a-z]+)?$/i,r=>`.mended${r||".glb"}`))}};dragOver=e=>{e.preventDefault(),this.setDragging(!0)};dragLeave=()=>this.setDragging(!1);drop=e=>{e.preventDefault(),this.setDragging(!1),this.openFiles([...e.dataTransfer?.files??[]])};setDragging(e){this.dragging=e,this.requestUpdate()}frame=e=>this.stage?.viewer?.frame(e.detail);look=e=>this.stage?.viewer?.setLook(e.detail);keyDown=e=>{let t=e.key.toLowerCase();if((e.ctrlKey||e.metaKey)&&(t==="z"||t==="y")&&!Fe(e)){e.preventDefault(),t==="y"||e.shiftKey?this.editor.redo():this.editor.undo();return}e.ctrlKey||e.metaKey||e.altKey||Fe(e)||(t==="f"?this.stage?.viewer?.frame():t==="b"&&this.stage?.viewer?.setLook({before:!0}))};keyUp=e=>{e.key.toLowerCase()==="b"&&this.stage?.viewer?.setLook({before:!1})}};function Fe(s){let e=s.composedPath()[0];return e instanceof HTMLTextAreaElement||e instanceof HTMLInputElement&&!["checkbox","radio","range","button"].includes(e.type)}customElements.define("darn-editor",ne);
