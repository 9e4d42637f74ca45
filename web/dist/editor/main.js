var m=class extends Error{constructor(t,r,n,o){super(n);this.status=t;this.code=r;this.retryAfter=o}status;code;retryAfter;name="ProblemError";get sessionIsGone(){return this.status===410||this.code==="session_not_found"}};function ee(i,e,t){let r=Number(e??Number.NaN),n=Number.isFinite(r)&&r>=0?r:void 0;try{let o=JSON.parse(t),s=(o.errors??[]).map(a=>`
${a.pointer??""} ${a.detail}`);return new m(i,o.code,o.detail+s.join(""),n)}catch{return new m(i,"",`The service answered with status ${i}.`,n)}}function $e(i){return i instanceof m?Ae(i.message):i instanceof TypeError&&/fetch|network/i.test(i.message)?"The service cannot be reached.":Ae(i instanceof Error?i.message:String(i))}function Se(i){return i instanceof DOMException&&i.name==="AbortError"}function Ae(i){let e=i.charAt(0).toUpperCase()+i.slice(1);return/[.!?]$/.test(e)?e:`${e}.`}var Ee={anchors:[],edits:[]};function Me(i,e){let t=r=>r.hole===void 0||e.has(r.hole);return{anchors:i.anchors.filter(t),edits:i.edits.filter(t)}}function T(i){return{...i.anchors.length>0&&{anchors:[...i.anchors]},...i.edits.length>0&&{edits:[...i.edits]}}}function Le(i,e){return{holes:i.map(t=>({id:t})),...T(e)}}function Te(i){let e;try{e=JSON.parse(i)}catch(a){throw new Error(`The constraints are not JSON: ${a instanceof Error?a.message:String(a)}`)}if(typeof e!="object"||e===null||Array.isArray(e))throw new Error("The constraints must be a JSON object.");let{holes:t,anchors:r=[],edits:n=[],...o}=e,s=Object.keys(o);if(s.length>0)throw new Error(`The editor does not use: ${s.join(", ")}.`);if(!te(r)||!te(n))throw new Error("`anchors` and `edits` must be lists of objects.");return{holes:t===void 0?void 0:ft(t),constraints:{anchors:r,edits:n}}}function ft(i){if(!te(i))throw new Error("`holes` must be a list of objects.");return i.map(e=>{let t=e.id;if(typeof t!="number"||!Number.isInteger(t))throw new Error("The editor reads holes by `id` alone.");return t})}function te(i){return Array.isArray(i)&&i.every(e=>typeof e=="object"&&e!==null)}function b(i,e){let{patchFaces:t=[],patchUvs:r=[],id:n=0}=i.hole,o=s=>[r[2*s],r[2*s+1]];for(let s=0;s+2<t.length;s+=3){let a=t.slice(s,s+3),d=mt(e,a.map(o));if(d!==void 0)return{hole:n,uv:e,vertices:a,weights:d}}}function x({positions:i},{vertices:e,weights:t}){return[0,1,2].map(r=>e.reduce((n,o,s)=>n+t[s]*i[3*o+r],0))}function k({positions:i},{vertices:e}){let[t,r,n]=e.map(c=>[...i.subarray(3*c,3*c+3)]),[o,s]=[re(r,t),re(n,t)],a=[o[1]*s[2]-o[2]*s[1],o[2]*s[0]-o[0]*s[2],o[0]*s[1]-o[1]*s[0]],d=Math.hypot(...a)||1;return a.map(c=>c/d)}function Oe(i){let{rimUvs:e=[]}=i.hole,t=e.length/2||1,r=[0,1].map(s=>e.reduce((a,d,c)=>c%2===s?a+d:a,0)/t),n=i.hole.patchUvs??[],o={uv:r,distance:Number.POSITIVE_INFINITY};for(let s=0;s+1<n.length;s+=2){let a=[n[s],n[s+1]],d=Math.hypot(a[0]-r[0],a[1]-r[1]);d<o.distance&&(o={uv:a,distance:d})}return o.uv}function Ce(i,e){let t;for(let r of i){let n=r.hole.rimPositions??[];for(let o=0;o+2<n.length;o+=3){let s=Math.hypot(...re(n.slice(o,o+3),e));s<(t?.distance??Number.POSITIVE_INFINITY)&&(t={patch:r,distance:s})}}return t?.patch}function re(i,e){return[i[0]-e[0],i[1]-e[1],i[2]-e[2]]}function mt([i,e],[t,r,n]){let o=(r[0]-t[0])*(n[1]-t[1])-(n[0]-t[0])*(r[1]-t[1]);if(o===0)return;let s=((i-t[0])*(n[1]-t[1])-(n[0]-t[0])*(e-t[1]))/o,a=((r[0]-t[0])*(e-t[1])-(i-t[0])*(r[1]-t[1]))/o,d=1-s-a,c=-1e-6;return d>=c&&s>=c&&a>=c?[d,s,a]:void 0}var g={grab:"Grab",twist:"Twist",pinch:"Pinch",anchor:"Anchor"};function ne(i,e){let t=e.hole.id??0,r=Oe(e),n=b(e,r);switch(i){case"grab":return{kind:i,hole:t,uv:r,offset:[0,0,0]};case"twist":return{kind:i,hole:t,uv:r,radius:.125,axis:n?k(e,n):[0,1,0],angle:0};case"pinch":return{kind:i,hole:t,uvs:[r,[r[0]+.1,r[1]]],amount:.5};case"anchor":return{kind:i,hole:t,position:n?x(e,n):[0,0,0],hard:!1}}}function oe(i,e){return{...i,edits:[...i.edits,yt(e)]}}function Re(i,{hole:e,position:t,hard:r},n){let o={hole:e,uv:[...n],position:[...t],...r&&{hard:r}};return{...i,anchors:[...i.anchors,o]}}function yt(i){let{hole:e}=i;switch(i.kind){case"grab":return{hole:e,grab:{uv:[...i.uv],offset:[...i.offset]}};case"twist":return{hole:e,twist:{uv:[...i.uv],radius:i.radius,axis:[...i.axis],angle:i.angle}};case"pinch":return{hole:e,pinch:{uvs:i.uvs.map(t=>[...t]),amount:i.amount}}}}var O=class{states;at=0;constructor(e){this.states=[e]}get present(){return this.states[this.at]}get canUndo(){return this.at>0}get canRedo(){return this.at+1<this.states.length}get next(){return this.states[this.at+1]}push(e){this.states.length=this.at+1,this.states.push(e),this.at+=1}undo(){this.at=Math.max(this.at-1,0)}redo(){this.at=Math.min(this.at+1,this.states.length-1)}};var F=class{running;waiting;offer(e){if(this.running!==void 0){this.waiting=e;return}this.running=this.run(e)}async settled(){this.waiting=void 0,await this.running}async run(e){for(let t=e;t!==void 0;)await t(),t=this.waiting,this.waiting=void 0;this.running=void 0}};var De=new Map([["HOLE",{plural:"Holes",singular:"Hole",color:"#d9480f",line:"solid"}],["TUBE_END",{plural:"Ends of sleeves",singular:"End of a sleeve",color:"#37a04d",line:"dotted"}],["OUTER_BOUNDARY",{plural:"Borders",singular:"Border",color:"#3f86c9",line:"dashed"}]]);function C(i){let e=i.toLowerCase().replaceAll("_"," "),t=e.charAt(0).toUpperCase()+e.slice(1);return De.get(i)??{plural:t,singular:t,color:"#862e9c",line:"dotted"}}function P(i){return i.kind==="HOLE"}function N(i){let e=[...De.keys()],t=new Map(e.map(n=>[n,[]]));for(let n of i){let o=n.kind??"LOOP_KIND_UNSPECIFIED";t.set(o,[...t.get(o)??[],n])}let r=n=>n.length??0;return[...t].filter(([,n])=>n.length>0).map(([n,o])=>[n,o.sort((s,a)=>r(a)-r(s))])}function y(i){return i===void 0||!Number.isFinite(i)?"\u2013":i!==0&&(Math.abs(i)>=1e6||Math.abs(i)<.001)?i.toExponential(2):String(Number(i.toPrecision(3)))}var I=class{constructor(e,t){this.service=e;this.scan=t}service;scan;opened;unfillable=new Map;get skipped(){let e=[...this.unfillable.values()],t=(this.opened?.session.skipped??[]).filter(({id:r})=>!this.unfillable.has(r??0));return[...e,...t]}mend(e,t,r){return this.within(e,r,async n=>{let{positions:o,report:s}=await this.service.mend(n.id,t,r);return n.met=JSON.stringify(t),{patches:Ue(n,o),report:s}})}preview(e,t){return this.within(e,{},async r=>{let n=await this.service.positions(r.id,t,{});return r.met=JSON.stringify(t),Ue(r,n)})}optimizeAnchor(e,t,r){return this.within(e,r,({id:n})=>this.service.optimizeAnchor(n,t,r))}result(e,t,r){return this.within(e,r,async n=>(n.met!==JSON.stringify(t)&&(await this.service.mend(n.id,t,r),n.met=JSON.stringify(t)),this.service.result(n.id,r)))}close(){this.opened!==void 0&&(this.service.close(this.opened.id),this.opened=void 0)}async within(e,t,r){try{return await r(await this.open(e,t))}catch(n){if(!(n instanceof m&&n.sessionIsGone))throw n;return this.opened=void 0,r(await this.open(e,t))}}async open(e,t){let r=e.join();if(this.opened!==void 0&&[this.opened.asked,this.opened.filled].includes(r))return this.opened;let n=await this.openOnFillable(e,t),o=n.id??"",s=await this.service.positions(o,{},t),a=await this.service.patches(o,{},t),d=Fe(n,s),c=new Map(d.map(p=>[p.hole.id??0,p.positions]));this.close();let l=[...c.keys()].join();return this.opened={id:o,asked:r,filled:l,session:n,dressing:{glb:a,positions:c},met:void 0},this.opened}async openOnFillable(e,t){let r=()=>e.filter(s=>!this.unfillable.has(s)),n=s=>this.service.openSession(this.scan,{holes:s.map(a=>({id:a}))},t),o=r();try{return await n(o.length>0?o:e)}catch(s){if(!(s instanceof m&&s.status===422)||e.length<2)throw s;let a=await this.service.openSession(this.scan,{},t);this.service.close(a.id??"");for(let c of a.skipped??[])e.includes(c.id??0)&&this.unfillable.set(c.id??0,c);let d=r();if(d.length===0||d.length===o.length)throw s;return n(d)}}};function Ue({session:i,dressing:e},t){return Fe(i,t).map(r=>({...r,dressing:e}))}function Fe(i,e){let t=0;return(i.holes??[]).map(r=>{let n=t+(r.patchUvs?.length??0)/2*3,o=e.subarray(t,n);return t=n,{hole:r,positions:o}})}var Ne={label:"Open",holes:[],constraints:Ee,patches:[],report:void 0},B=class extends EventTarget{constructor(t){super();this.service=t;this.limits=t.info().catch(()=>{})}service;scan;chosen=new Set;skipped=[];tool="look";draft;draftPatches;found;work;problem;message="";history=new O(Ne);session;live=new F;limits;get step(){return this.history.present}get patches(){return this.draftPatches??this.step.patches}get undoLabel(){return this.history.canUndo?this.history.present.label:void 0}get redoLabel(){return this.history.next?.label}reportOf(t){return this.step.report?.holes?.find(r=>r.id===t)}async open(t,r){await this.working(`Sending ${r}`,async n=>{let o=(await this.limits)?.limits.bodyBytes;if(o!==void 0&&t.size+4096>o)throw new Error(`${r} has ${t.size} bytes; this service takes at most ${o}.`);let s=await t.arrayBuffer(),{loops:a=[],notes:d=[]}=await this.service.holes(t,n);this.session?.close(),this.session=new I(this.service,t),this.scan={file:t,name:r,bytes:s,loops:a,notes:d},this.history=new O(Ne),this.chosen=new Set(a.filter(P).map(l=>l.id??0)),this.skipped=[],this.found=void 0,this.dropDraft();let c=this.chosen.size;this.message=`${r} is open: ${c} ${c===1?"hole":"holes"} in ${a.length} boundary loops.`,this.dispatchEvent(new Event("opened"))})}async openAddress(t){let r=decodeURIComponent(t.pathname.split("/").pop()??"")||t.host,n;await this.working(`Loading ${r}`,async({signal:o})=>{let s=await fetch(t,{signal:o??null});if(!s.ok)throw new Error(`${t.href} answered with status ${s.status}.`);n=new Blob([await s.arrayBuffer()],{type:"model/gltf-binary"})}),n!==void 0&&await this.open(n,r)}choose(t){this.chosen=t,this.changed()}async mend(){let t=[...this.chosen].sort((n,o)=>n-o),r=`${t.length} ${t.length===1?"hole":"holes"}`;await this.apply(`Mend ${r}`,t,Me(this.step.constraints,this.chosen))}preview(t){this.draft=t,this.changed(),t.kind!=="anchor"&&this.live.offer(async()=>{let{step:r,session:n}=this;if(!(this.draft!==t||n===void 0))try{let o=await n.preview(r.holes,T(oe(r.constraints,t)));this.draft!==void 0&&this.step===r&&(this.draftPatches=o,this.changed())}catch(o){this.report(o)}})}async commit(){let{draft:t}=this;if(t!==void 0)if(t.kind==="anchor")await this.placeAnchor(t);else{let r=oe(this.step.constraints,t);await this.apply(g[t.kind],this.step.holes,r)}}dropDraft(){this.draft=void 0,this.draftPatches=void 0,this.changed()}async findAnchor({hole:t,position:r},n){let o;return await this.working(n?"Drawing the map":"Searching",async s=>{let a={hole:t,target:[...r],map:n},d=await this.session?.optimizeAnchor(this.step.holes,a,s);d!==void 0&&(o={hole:t,found:d},this.found=o,this.message=`Found after ${d.evaluations} evaluations of the network.`)}),o}async placeAnchor(t){let r=(await this.findAnchor(t,!1))?.found.uv;if(r!==void 0){let n=Re(this.step.constraints,t,r);await this.apply(t.hard?"Hard anchor":g.anchor,this.step.holes,n)}}undo(){this.travel(()=>this.history.undo(),"Undone")}redo(){this.travel(()=>this.history.redo(),"Redone")}setTool(t){this.tool=t,this.dropDraft()}constraintsText(){let{holes:t,constraints:r}=this.step;return JSON.stringify(Le(t,r),void 0,2)}async loadConstraints(t){let r;try{r=Te(t)}catch(d){this.report(d);return}let{scan:n,step:o}=this,s=(n?.loops??[]).filter(P).map(d=>d.id??0),a=[...r.holes??(o.holes.length>0?o.holes:s)].sort((d,c)=>d-c);await this.apply("Load constraints",a,r.constraints),this.choose(new Set(this.step.holes))}async result(){let t;return await this.working("Saving",async r=>{let{holes:n,constraints:o}=this.step;t=await this.session?.result(n,T(o),r),this.message=`Saved with ${n.length} filled ${n.length===1?"hole":"holes"}.`}),t}say(t){this.message=t,this.changed()}report(t){Se(t)||(this.problem=$e(t),this.changed())}clearProblem(){this.problem=void 0,this.changed()}async apply(t,r,n){await this.working(t,async o=>{if(this.session===void 0||r.length===0)return;let{patches:s,report:a}=await this.session.mend(r,T(n),o);this.skipped=this.session.skipped;let d=s.map(c=>c.hole.id??0);this.history.push({label:t,holes:d,constraints:n,patches:s,report:a}),this.message=this.messageOfStep(t,this.history.present)}),this.dropDraft()}messageOfStep(t,r){let n=r.patches.reduce((o,s)=>o+(s.hole.patchFaces?.length??0)/3,0);return`${t}: ${r.patches.length} filled, ${n.toLocaleString("en")} new triangles.`}travel(t,r){let n=this.step;this.work===void 0&&(t(),this.step!==n&&(this.message=`${r}. Now: ${this.step.label}.`,this.found=void 0,this.problem=void 0),this.dropDraft())}async working(t,r){this.work?.stop.abort();let n=new AbortController,o=(s,a)=>{n.signal.aborted||(this.work={label:s,share:a,stop:n},this.changed())};this.problem=void 0,o(t,void 0);try{await this.live.settled(),await r({signal:n.signal,onSent:s=>o(s<1?t:"Computing",s<1?s:void 0),onWait:s=>o(`The service is busy; waiting ${s} s`,void 0)})}catch(s){this.report(s)}finally{this.work?.stop===n&&(this.work=void 0),this.changed()}}changed(){this.dispatchEvent(new Event("change"))}};function Ie(i,e){let t=/boundary="?([^";]+)"?/.exec(i)?.[1];if(!i.startsWith("multipart/mixed")||t===void 0)throw new Error(`multipart/mixed was asked for, ${i} was answered`);let r=new Uint8Array(e),n=new Map,o=0;for(;;){let s=bt(r,`\r
\r
`,o);if(s<0){if(!new TextDecoder().decode(r.subarray(o)).startsWith(`--${t}--`))throw new Error("a multipart/mixed answer ends before its last line");return n}let a=new TextDecoder().decode(r.subarray(o,s)).toLowerCase(),d=Number(/content-length: *(\d+)/.exec(a)?.[1]??Number.NaN),c=/name="([^"]*)"/.exec(a)?.[1],l=s+4;if(!a.includes(`--${t.toLowerCase()}`)||c===void 0||!(l+d<=r.length))throw new Error("a part of a multipart/mixed answer cannot be read");let p=/content-type: *([^\r\n;]+)/.exec(a)?.[1]??"";n.set(c,{mediaType:p,body:r.slice(l,l+d)}),o=l+d+2}}function bt(i,e,t){let r=[...e].map(o=>o.charCodeAt(0)),n=i.length-r.length;for(let o=t;o<=n;o+=1)if(r.every((s,a)=>i[o+a]===s))return o;return-1}var gt=5,vt=60;function ie(i,e,t={}){return Be(t,()=>xt(i,e,t))}function R(i,e,t={}){return Be(t,async()=>{let r=await fetch(i,{...e,signal:t.signal??null});if(!r.ok)throw ee(r.status,r.headers.get("retry-after"),await r.text());return{contentType:r.headers.get("content-type")??"",body:await r.arrayBuffer()}})}function D(i){return JSON.parse(new TextDecoder().decode(i.body))}async function Be(i,e){for(let t=1;;t+=1)try{return await e()}catch(r){let n=r instanceof m&&r.status===503?r.retryAfter:void 0;if(n===void 0||n>vt||t===gt)throw r;i.onWait?.(n),await wt(n,i.signal)}}function wt(i,e){return new Promise((t,r)=>{let n=setTimeout(t,i*1e3);e?.addEventListener("abort",()=>{clearTimeout(n),r(new DOMException("stopped","AbortError"))})})}function xt(i,e,{onSent:t,signal:r}){return new Promise((n,o)=>{let s=new XMLHttpRequest;s.open("POST",i),s.responseType="arraybuffer",s.upload.onprogress=a=>{a.lengthComputable&&a.total>0&&t?.(a.loaded/a.total)},s.onload=()=>{let a=s.response;if(s.status<400)n({contentType:s.getResponseHeader("content-type")??"",body:a});else{let d=new TextDecoder().decode(a);o(ee(s.status,s.getResponseHeader("retry-after"),d))}},s.onerror=()=>o(new Error("The service cannot be reached, or it closed the connection.")),s.onabort=()=>o(new DOMException("stopped","AbortError")),r?.addEventListener("abort",()=>s.abort()),s.send(e)})}var V=class{constructor(e){this.base=e}base;async info(){return D(await R(this.at("info"),{}))}async holes(e,t){let r=new FormData;return r.append("scan",e,"scan"),D(await ie(this.at("holes"),r,t))}async openSession(e,t,r){let n=new FormData;return n.append("scan",e,"scan"),n.append("constraints",new Blob([JSON.stringify(t)],{type:"application/json"}),"constraints"),D(await ie(this.at("sessions"),n,r))}async positions(e,t,r){let n=await this.inpaint(e,t,"application/octet-stream",r);return new Float32Array(n.body)}async mend(e,t,r){let o=await this.inpaint(e,t,"multipart/mixed, application/octet-stream;q=0.9",r),{report:s,patches:a}=kt(o);return{report:s,positions:new Float32Array(a.buffer)}}async patches(e,t,r){return(await this.inpaint(e,t,"model/gltf-binary",r)).body}async optimizeAnchor(e,t,r){return D(await R(this.at(`sessions/${e}/optimize-anchor`),Ve(t),r))}async result(e,t){let r=await R(this.at(`sessions/${e}/result`),{},t);return new Blob([r.body],{type:r.contentType})}close(e){fetch(this.at(`sessions/${e}`),{method:"DELETE",keepalive:!0}).catch(()=>{})}inpaint(e,t,r,n){let o=Ve(t);return o.headers={...o.headers,accept:r},R(this.at(`sessions/${e}/inpaint`),o,n)}at(e){return new URL(e,this.base)}};function Ve(i){return{method:"POST",headers:{"content-type":"application/json"},body:JSON.stringify(i)}}function kt(i){let e=Ie(i.contentType,i.body),[t,r]=[e.get("report"),e.get("patches")];if(t===void 0||r===void 0)throw new Error("the answer has no report or no patches");return{report:JSON.parse(new TextDecoder().decode(t.body)),patches:r.body}}import{LitElement as Dr,css as Ur,html as L,nothing as pt}from"./vendor.js";function j(i,e){let t=document.createElement("a");t.href=URL.createObjectURL(i),t.download=e,t.click(),setTimeout(()=>URL.revokeObjectURL(t.href),6e4)}import{css as $t,html as je,nothing as A,svg as ae}from"./vendor.js";import{LitElement as At}from"./vendor.js";import{css as Pt}from"./vendor.js";var H=Pt`
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
`;var h=class extends At{static styles=[H];editor;changed=()=>this.requestUpdate();connectedCallback(){super.connectedCallback(),this.editor.addEventListener("change",this.changed)}disconnectedCallback(){super.disconnectedCallback(),this.editor.removeEventListener("change",this.changed)}};var $=256,He=64,de=class extends h{static styles=[h.styles,$t`
      svg {
        display: block;
        width: 100%;
        max-width: 320px;
        border: 1px solid var(--line);
        border-radius: 5px;
      }
    `].flat();render(){let{draft:e,found:t,step:r}=this.editor,n=e?.hole??t?.hole??r.patches[0]?.hole.id,o=r.patches.find(c=>c.hole.id===n);if(o===void 0)return A;let s=t!==void 0&&t.hole===n?t.found:void 0,a=s?.mapPng||o.hole.chartPng,d=(s?.path??[]).map(({cell:c})=>St(c??[]));return je`
      <h2>Chart of hole ${n}</h2>
      <svg viewBox="0 0 ${$} ${$}" role="img" aria-label=${this.words(n??0)}>
        ${a?ae`<image href="data:image/png;base64,${a}" width=${$} height=${$} />`:A}
        ${d.length>1?ae`<polyline points=${d.map(c=>ze(c).join()).join(" ")} fill="none" stroke="#0b7285" stroke-width="2" />`:A}
        ${this.placed(n??0).map(c=>se(c,"#ffffff"))}
        ${e?Et(e).map(c=>se(c,"#22b8cf")):A}
        ${s?.uv?se(s.uv,"#ffd43b"):A}
      </svg>
      ${s?je`<p class="small">
              The point belongs at u ${s.uv?.[0]?.toFixed(3)}, v ${s.uv?.[1]?.toFixed(3)}; the search went
              through ${d.length} ${d.length===1?"cell":"cells"}.
            </p>`:A}
    `}placed(e){let{anchors:t,edits:r}=this.editor.step.constraints,n=o=>o.hole===void 0||o.hole===e;return[...t.filter(n).map(({uv:o})=>o),...r.filter(n).flatMap(({grab:o,twist:s,pinch:a})=>[o?.uv,s?.uv,...a?.uvs??[]])].filter(o=>o?.length===2)}words(e){let t=this.placed(e).length;return`The cloth around hole ${e}, laid flat, with ${t} ${t===1?"place":"places"} of constraints.`}};function ze([i,e]){return[i*$,(1-e)*$]}function se(i,e){let[t,r]=ze(i);return ae`<circle cx=${t} cy=${r} r="5" fill=${e} stroke="#1c2026" stroke-width="1.5" />`}function St([i=0,e=0]){return[(i+.5)/He,(e+.5)/He]}function Et(i){switch(i.kind){case"grab":case"twist":return[i.uv];case"pinch":return i.uvs;case"anchor":return[]}}customElements.define("darn-chart",de);import{html as Mt}from"./vendor.js";var ce=class extends h{render(){let{work:e}=this.editor;return Mt`
      <details>
        <summary>Constraints as JSON</summary>
        <p class="quiet small">
          The part <code>constraints</code> of <code>POST /inpaint</code>, which gives the same bytes as “Save the
          scan”.
        </p>
        <textarea
          rows="10"
          spellcheck="false"
          aria-label="Constraints as JSON"
          .value=${this.editor.constraintsText()}
        ></textarea>
        <div class="row">
          <button @click=${this.copy}>Copy</button>
          <button ?disabled=${e!==void 0} @click=${this.load}>Load</button>
        </div>
      </details>
    `}get field(){return this.renderRoot.querySelector("textarea")}copy=async()=>{let e=this.field?.value??"";try{await navigator.clipboard.writeText(e)}catch{this.field?.select(),document.execCommand("copy")}this.editor.say("Copied.")};load=()=>{this.editor.loadConstraints(this.field?.value??"")}};customElements.define("darn-constraints",ce);import{css as Lt,html as v,nothing as We,svg as Tt}from"./vendor.js";var le=class extends h{static styles=[h.styles,Lt`
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
    `].flat();lastClicked;render(){let{scan:e,chosen:t,work:r}=this.editor,n=e?.loops??[],o=n.filter(P).map(s=>s.id??0);return v`
      <h2>Holes</h2>
      ${N(n).map(([s,a])=>this.group(s,a))}
      ${o.length===0?v`<p>This scan has no holes to fill.</p>`:We}
      <div class="row">
        <button class="main" id="mend" ?disabled=${t.size===0||r!==void 0} @click=${this.mend}>
          Mend ${t.size===1?"1 hole":`${t.size} holes`}
        </button>
        <button ?disabled=${o.length===0} @click=${()=>this.editor.choose(new Set(o))}>All</button>
        <button ?disabled=${t.size===0} @click=${()=>this.editor.choose(new Set)}>None</button>
      </div>
    `}group(e,t){let r=C(e),n={solid:"",dashed:"7 4",dotted:"2 4"}[r.line],o=Tt`<svg width="30" height="8" aria-hidden="true">
      <line x1="0" y1="4" x2="30" y2="4" stroke=${r.color} stroke-width="3" stroke-dasharray=${n} />
    </svg>`;return v`
      <h3>${o}${r.plural} (${t.length})</h3>
      <ul aria-label=${r.plural}>
        ${t.map(s=>this.item(s,t))}
      </ul>
    `}item(e,t){let r=e.id??0,{step:n,skipped:o,chosen:s}=this.editor,a=n.holes.includes(r),d=o.find(l=>l.id===r&&l.code!=="not_selected"),c=`${C(e.kind??"").singular} ${r}`;return v`
      <li>
        ${P(e)?v`<input
                type="checkbox"
                aria-label="Choose ${c}"
                .checked=${s.has(r)}
                @click=${l=>this.toggle(l,r,t)}
              />`:v`<span></span>`}
        <button @click=${()=>this.frame(r)} aria-label="Show ${c}, length ${y(e.length)}">
          ${c}${a?" \u2713 mended":""}
        </button>
        <span class="quiet small">${y(e.length)} · ${e.vertices} vertices</span>
        ${d?v`<span class="why quiet small">Left open: ${d.reason}.</span>`:We}
      </li>
    `}toggle(e,t,r){let n=r.map(l=>l.id??0),o=new Set(this.editor.chosen),[s,a]=[n.indexOf(this.lastClicked??t),n.indexOf(t)],d=e.shiftKey&&s>=0?n.slice(Math.min(s,a),Math.max(s,a)+1):[t],c=e.target.checked;for(let l of d)c?o.add(l):o.delete(l);this.lastClicked=t,this.editor.choose(o)}frame(e){this.dispatchEvent(new CustomEvent("darn-frame",{detail:e,bubbles:!0,composed:!0}))}mend=()=>{this.editor.mend()}};customElements.define("darn-holes",le);import{css as Ot,html as Ge}from"./vendor.js";var Ct=[["textured","Textured"],["shaded","Shaded"],["wireframe","Wireframe"]],he=class extends h{static styles=[h.styles,Ot`
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
    `].flat();render(){return Ge`
      <h2>Look</h2>
      <fieldset>
        <legend class="quiet small">Surface</legend>
        <div class="row">
          ${Ct.map(([e,t])=>Ge`
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
    `}look(e){this.dispatchEvent(new CustomEvent("darn-look",{detail:e,bubbles:!0,composed:!0}))}};customElements.define("darn-look",he);function _e(i){let e=i.patch??{},t=(e.faces??0).toLocaleString("en"),r=[`Hole ${i.id}: ${t} new triangles, area ${y(e.area)}, on a rim of length ${y(i.length)}.`,`${Rt(e.stretchMean,e.stretchMax)} ${Dt(e.selfIntersections??0)}`,Ut(e.networkShare)];for(let n of i.anchors??[]){let o=n.beyondReach??0,s=o>0?`; ${y(o)} of that is beyond the cloth's reach`:"";r.push(`An anchor is ${y(n.distance)} away from the cloth${s}.`)}for(let n of i.edits??[])r.push(`A gesture is followed to within ${y(n.distance)}.`);return[...r,...i.notes??[]].filter(n=>n!=="")}function qe(i){let e=i.holes?.length??0,t=i.skipped?.length??0,r=t===1?"1 loop is":`${t} loops are`;return`${Ke(e,"hole")} filled; ${r} left open.`}function Rt(i,e){return i===void 0||e===void 0?"":`Lengths differ from those of flat cloth by ${pe(i-1)} on average, ${pe(e-1)} at most.`}function Dt(i){return i===0?"No triangles cross.":`${Ke(i,"pair")} of triangles cross.`}function Ut(i){return i===void 0?"":i>=.995?"The network predicts its folds.":i<=.005?"A fair surface without folds, as the cloth around it has none.":`${pe(i)} of the network's folds, for the rest a fair surface.`}function pe(i){return`${Number((Math.abs(i)*100).toPrecision(2))} %`}function Ke(i,e){return`${i} ${e}${i===1?"":"s"}`}import{css as Ft,html as S,nothing as Nt}from"./vendor.js";var ue=class extends h{static styles=[h.styles,Ft`
      .hole {
        margin-bottom: 0.75rem;
      }
      .hole p {
        margin: 0;
      }
    `].flat();render(){let{report:e}=this.editor.step,t=[...this.editor.scan?.notes??[],...e?.notes??[]];return e===void 0?t.length===0?Nt:S`<h2>Notes</h2>
            ${t.map(r=>S`<p>${r}</p>`)}`:S`
      <h2>Report</h2>
      <p>${qe(e)}</p>
      ${[...new Set(t)].map(r=>S`<p>${r}</p>`)}
      ${(e.holes??[]).map(r=>S`<div class="hole">${_e(r).map(n=>S`<p>${n}</p>`)}</div>`)}
      <button
        @click=${()=>j(new Blob([JSON.stringify(e,void 0,2)]),`${this.baseName}.report.json`)}
      >
        Save the report
      </button>
    `}get baseName(){return(this.editor.scan?.name??"scan").replace(/\.(glb|gltf)$/i,"")}};customElements.define("darn-report",ue);import{Vector3 as W}from"./vendor.js";import{BufferAttribute as It,BufferGeometry as Bt,Group as Vt,Line as Je,LineBasicMaterial as jt,LineLoop as Ht,Mesh as Ye,MeshBasicMaterial as zt,SphereGeometry as Wt,Vector3 as fe}from"./vendor.js";var Gt=7,Xe=64,z=class{group=new Vt;ball=new Wt(1,24,16);ballMaterial=new zt({color:750213,depthTest:!1,transparent:!0});lineMaterial=new jt({color:750213,depthTest:!1,transparent:!0});show({handles:e=[],tethers:t=[],ring:r=[]}){this.clear();for(let n of e){let o=new Ye(this.ball,this.ballMaterial);o.position.copy(n),this.group.add(o)}for(let n of t)this.group.add(new Je(Qe(n),this.lineMaterial));r.length>0&&this.group.add(new Ht(Qe(r),this.lineMaterial)),this.group.children.forEach(n=>n.renderOrder=10)}clear(){for(let e of this.group.children)e instanceof Je&&e.geometry.dispose();this.group.clear()}fit(e,t){let r=2*Math.tan(e.fov*Math.PI/360)/Math.max(t,1);for(let n of this.group.children)n instanceof Ye&&n.scale.setScalar(Gt*r*e.position.distanceTo(n.position))}};function Ze(i,e,t){let n=(Math.abs(e.x)<.9?new fe(1,0,0):new fe(0,1,0)).cross(e).normalize(),o=new fe().crossVectors(e,n).normalize();return Array.from({length:Xe},(s,a)=>{let d=2*Math.PI*a/Xe;return i.clone().addScaledVector(n,t*Math.cos(d)).addScaledVector(o,t*Math.sin(d))})}function Qe(i){let e=new Float32Array(i.flatMap(t=>t.toArray()));return new Bt().setAttribute("position",new It(e,3))}var _t=64;function et(i,e){let{draft:t}=i,r=t?.hole??e?.hole,n=i.step.patches.find(s=>s.hole.id===r),o=i.patches.find(s=>s.hole.id===r);return n===void 0||o===void 0?{}:t===void 0?e?{handles:[U(o,e)]}:{}:qt(t,n,o,i.reportOf(t.hole)?.grid?.spacingMean??0)}function qt(i,e,t,r){switch(i.kind){case"grab":{let n=b(e,i.uv),o=n&&U(e,n).add(new W(...i.offset));return n&&o?{handles:[o],tethers:[[U(t,n),o]]}:{}}case"twist":{let n=b(t,i.uv);if(n===void 0)return{};let o=U(t,n),s=Ze(o,new W(...k(t,n)),i.radius*_t*r);return{handles:[o],ring:s}}case"pinch":{let o=i.uvs.map(d=>b(t,d)).filter(d=>d!==void 0).map(d=>U(t,d)),[s,a]=o;return{handles:o,tethers:s&&a?[[s,a]]:[]}}case"anchor":return{handles:[new W(...i.position)]}}}function U(i,e){return new W(...x(i,e))}import{Vector3 as E}from"./vendor.js";var Kt=4,Jt=Math.PI/200,me={step:1.1,least:.02,most:.5},tt=new Map([["x",new E(1,0,0)],["y",new E(0,1,0)],["z",new E(0,0,1)]]),G=class{constructor(e,t){this.viewer=e;this.editor=t;let{signal:r}=this.listening,n={capture:!0,signal:r},{canvas:o}=e;o.addEventListener("pointerdown",s=>this.down(s),n),o.addEventListener("pointermove",s=>this.move(s),n),o.addEventListener("pointerup",s=>this.up(s),n),o.addEventListener("pointercancel",()=>this.cancel(),n),o.addEventListener("wheel",s=>this.wheel(s),{...n,passive:!1}),addEventListener("keydown",s=>this.key(s,!0),{signal:r}),addEventListener("keyup",s=>this.key(s,!1),{signal:r})}viewer;editor;hold;firstOfPinch;heldAxis;radius=.125;listening=new AbortController;get waitingPoint(){return this.editor.tool==="pinch"?this.firstOfPinch:void 0}cancel(){this.hold=void 0,this.firstOfPinch=void 0,this.editor.dropDraft()}dispose(){this.listening.abort()}down(e){let{tool:t,work:r}=this.editor;if(this.hold!==void 0){e.stopImmediatePropagation();return}if(t==="look"||r!==void 0||e.button!==0||!e.isPrimary)return;let n=this.viewer.pick(e.clientX,e.clientY),o=this.held(n?.cloth);n===void 0||o===void 0&&(t!=="anchor"||this.editor.step.patches.length===0)||(e.stopImmediatePropagation(),this.viewer.canvas.focus(),this.viewer.canvas.setPointerCapture(e.pointerId),this.hold={pointer:e.pointerId,x:e.clientX,y:e.clientY,hit:n,cloth:o,moved:!1})}move(e){let{hold:t}=this;if(t===void 0||e.pointerId!==t.pointer)return;e.stopImmediatePropagation(),t.moved||=Math.hypot(e.clientX-t.x,e.clientY-t.y)>Kt;let r=t.moved?this.dragged(t,e):void 0;r!==void 0&&this.editor.preview(r)}up(e){let{hold:t}=this;if(t===void 0||e.pointerId!==t.pointer)return;e.stopImmediatePropagation(),this.hold=void 0;let{tool:r}=this.editor;r==="pinch"?this.pinched(t):r==="anchor"&&!t.moved?(this.editor.preview(this.anchorAt(t,t.hit.position)),this.editor.commit()):t.moved&&this.editor.draft!==void 0&&this.editor.commit()}dragged(e,t){let{cloth:r}=e;switch(this.editor.tool){case"grab":return r&&this.grabbed(r,t);case"twist":return r&&this.twisted(r,t.clientX-e.x);case"anchor":{let n=this.viewer.onScreenPlane(t.clientX,t.clientY,e.hit.position);return n&&this.anchorAt(e,n)}default:return}}grabbed({point:e,position:t,normal:r},n){let{clientX:o,clientY:s}=n,a=n.shiftKey?r:tt.get(this.heldAxis??""),d=a?this.viewer.onLine(o,s,t,a):this.viewer.onScreenPlane(o,s,t),{hole:c,uv:l}=e;return d&&{kind:"grab",hole:c,uv:l,offset:d.sub(t).toArray()}}twisted({point:e,normal:t},r){let n=t.clone();n.dot(this.viewer.camera.getWorldDirection(new E))>0&&n.negate();let{hole:o,uv:s}=e;return{kind:"twist",hole:o,uv:s,radius:this.radius,axis:n.toArray(),angle:-r*Jt}}anchorAt({cloth:e},t){let r=t.toArray(),n=Ce(this.editor.step.patches,r)?.hole.id??0,{draft:o}=this.editor,s=o?.kind==="anchor"&&o.hard;return{kind:"anchor",hole:e?.point.hole??n,position:r,hard:s}}pinched({cloth:e}){let t=this.firstOfPinch;if(e===void 0)return;if(t===void 0||t.hole!==e.point.hole){this.firstOfPinch=e.point,this.editor.say("Pinch: click the second point.");return}this.firstOfPinch=void 0;let r=[t.uv,e.point.uv];this.editor.say("Pinch: choose how much, then apply."),this.editor.preview({kind:"pinch",hole:t.hole,uvs:r,amount:.5})}wheel(e){if(this.editor.tool!=="twist"||this.viewer.pick(e.clientX,e.clientY)?.cloth===void 0)return;e.preventDefault(),e.stopImmediatePropagation();let t=this.radius*me.step**-Math.sign(e.deltaY);this.radius=Math.min(Math.max(t,me.least),me.most);let{draft:r}=this.editor;r?.kind==="twist"?this.editor.preview({...r,radius:this.radius}):this.editor.say(`Twist: radius ${this.radius.toFixed(3)} of the chart.`)}key(e,t){let r=e.key.toLowerCase();t&&r==="escape"?this.cancel():tt.has(r)&&(t?this.hold!==void 0:r===this.heldAxis)&&(this.heldAxis=t?r:void 0)}held(e){let t=this.editor.step.patches.find(({hole:r})=>r.id===e?.hole);return e&&t&&{point:e,position:new E(...x(t,e)),normal:new E(...k(t,e))}}};import{Box3 as vr,DirectionalLight as wr,HemisphereLight as xr,OrbitControls as kr,PerspectiveCamera as Pr,Plane as Ar,Raycaster as $r,Scene as Sr,Sphere as ve,Vector2 as Er,Vector3 as M,WebGLRenderer as Mr}from"./vendor.js";function rt(i,e){let t=new Set(e),r=new Map;for(let n of i){let{centroid:o=[],length:s=0}=n,a;for(let d of t){let l=(Math.hypot(...d.centroid.map((p,f)=>p-(o[f]??0)))+Math.abs(d.length-s))/(s||1);l<(a?.cost??.05)&&(a={line:d,cost:l})}a!==void 0&&(t.delete(a.line),r.set(n.id??0,a.line))}return r}import{GLTFLoader as dr,Mesh as dt,MeshStandardMaterial as cr,Triangle as lr,Vector3 as st}from"./vendor.js";import{Box3 as Yt,BufferAttribute as Xt,DoubleSide as Qt,GLTFLoader as Zt,Mesh as er,MeshBVH as tr,MeshStandardMaterial as rr,Vector3 as it,acceleratedRaycast as nr}from"./vendor.js";var _=class{worker;waiting=new Map;nextId=0;async boundary(e){let t=await this.ask({...e,job:"boundary"});return"lines"in t?t.lines:nt(t)}async tree(e){let t=await this.ask({...e,job:"tree"});return"tree"in t?t.tree:nt(t)}stop(){this.worker?.terminate(),this.worker=void 0;for(let[e,t]of this.waiting)t({id:e,error:"stopped"});this.waiting.clear()}ask(e){this.worker??=this.start();let t=this.nextId;this.nextId+=1;let r=new Promise(n=>this.waiting.set(t,n));return this.worker.postMessage({...e,id:t},[e.positions.buffer,e.triangles.buffer]),r}start(){let e=new Worker(new URL("./worker.js",import.meta.url),{type:"module"});return e.onmessage=({data:t})=>{this.waiting.get(t.id)?.(t),this.waiting.delete(t.id)},e.onerror=()=>this.stop(),e}};function nt(i){throw new Error("error"in i?i.error:"the worker answered something else")}var or=12172998;function K(i,e){return new rr({color:i,roughness:.85,side:Qt,wireframe:e==="wireframe"})}var q=class i{constructor(e){this.root=e;e.updateMatrixWorld(!0),this.bounds=new Yt().setFromObject(e),e.traverse(t=>{t instanceof er&&(this.own.set(t,t.material),"isSkinnedMesh"in t||(t.raycast=nr))})}root;own=new Map;jobs=new _;bounds;plain;static async load(e){let t=await new Zt().parseAsync(e,"");return new i(t.scene)}get meshes(){return[...this.own.keys()]}setShading(e){this.plain?.dispose();let t=e==="textured"?void 0:K(or,e);this.plain=t;for(let[r,n]of this.own)r.material=t??n}materialNear(e){let t,r=new it;for(let[n,o]of this.own){let s=n.geometry.getAttribute("position");for(let a=0;a<s.count;a+=1){let d=r.fromBufferAttribute(s,a).applyMatrix4(n.matrixWorld).distanceToSquared(e);d<(t?.distance??Number.POSITIVE_INFINITY)&&(t={distance:d,material:Array.isArray(o)?o[0]:o})}}return t?.material}boundaryLines(){return this.jobs.boundary(sr(this.meshes.map(e=>ot(e,e.matrixWorld))))}async buildTrees(){for(let e of this.meshes){let t=await this.jobs.tree(ot(e,void 0));e.geometry.boundsTree=tr.deserialize(t,e.geometry)}}pick(e){return e.firstHitOnly=!0,e.intersectObjects(this.meshes,!1)[0]}dispose(){this.jobs.stop(),this.plain?.dispose();for(let[e,t]of this.own){e.geometry.dispose();for(let r of Array.isArray(t)?t:[t])ar(r)}}};function ot({geometry:i},e){let t=i.getAttribute("position"),r=new Float32Array(3*t.count),n=new it;for(let s=0;s<t.count;s+=1)n.fromBufferAttribute(t,s),e!==void 0&&n.applyMatrix4(e),n.toArray(r,3*s);let o=i.index===null?ir(t.count):new Uint32Array(i.index.array);return{positions:r,triangles:o}}function ir(i){let e=new Uint32Array(i);for(let t=0;t<i;t+=1)e[t]=t;return e}function sr(i){let e=s=>s.reduce((a,d)=>a+d.length,0),t=new Float32Array(e(i.map(s=>s.positions))),r=new Uint32Array(e(i.map(s=>s.triangles))),[n,o]=[0,0];for(let s of i){t.set(s.positions,n);let a=n/3;r.set(s.triangles.map(d=>d+a),o),n+=s.positions.length,o+=s.triangles.length}return{positions:t,triangles:r}}function ar(i){for(let e of Object.values(i))typeof e=="object"&&e!==null&&"isTexture"in e&&e.dispose();i.dispose()}function ye(i){return new Xt(i,3)}async function ct(i){let{scene:e}=await new dr().parseAsync(i,"");e.updateMatrixWorld(!0);let t=[];return e.traverse(r=>{r instanceof dt&&t.push(r.geometry.applyMatrix4(r.matrixWorld))}),t}var J=class{constructor(e,t,r){this.patch=e;let n=e.hole.id??0,o=e.dressing.positions.get(n)??e.positions,s=t.getAttribute("position");this.rim=(e.hole.rimUvs?.length??0)/2,this.corners=hr(s.array,o),this.firstNormals=new Float32Array(t.getAttribute("normal").array);let a=at(o,e.hole.patchFaces??[]);this.sides=Float32Array.from(this.corners,(d,c)=>[0,1,2].reduce((p,f)=>p+(a[3*d+f]??0)*(this.firstNormals[3*c+f]??0),0)<0?-1:1),t.setAttribute("position",ye(new Float32Array(3*this.corners.length))),t.setAttribute("normal",ye(new Float32Array(3*this.corners.length))),this.mesh=new dt(t,r),this.mesh.name=`hole ${n}`,this.update(e)}patch;mesh;corners;rim;firstNormals;sides;get hole(){return this.patch.hole.id??0}get shown(){return this.patch}update(e){this.patch=e;let{geometry:t}=this.mesh,[r,n]=[t.getAttribute("position"),t.getAttribute("normal")],o=at(e.positions,e.hole.patchFaces??[]);for(let[s,a]of this.corners.entries()){let d=this.sides[s];for(let c=0;c<3;c+=1){let l=3*s+c;r.array[l]=e.positions[3*a+c],n.array[l]=a<this.rim?this.firstNormals[l]:d*o[3*a+c]}}r.needsUpdate=!0,n.needsUpdate=!0,t.computeBoundingSphere(),t.computeBoundingBox()}pointOf(e){if(e.face===null||e.face===void 0)return;let t=[e.face.a,e.face.b,e.face.c].map(c=>this.corners[c]),[r,n,o]=t.map(c=>this.vertex(c)),s=lr.getBarycoord(e.point,r,n,o,new st)?.toArray();if(s===void 0)return;let a=this.patch.hole.patchUvs??[],d=[0,1].map(c=>t.reduce((l,p,f)=>l+s[f]*a[2*p+c],0));return b(this.patch,d)}dispose(){this.mesh.geometry.dispose()}vertex(e){return new st().fromArray(this.patch.positions,3*e)}};function hr(i,e){let t=(n,o)=>n.subarray(3*o,3*o+3).join(),r=new Map;for(let n=0;n<e.length/3;n+=1)r.set(t(e,n),n);return Uint32Array.from({length:i.length/3},(n,o)=>r.get(t(i,o))??pr(e,i.subarray(3*o,3*o+3)))}function pr(i,e){let t={vertex:0,distance:Number.POSITIVE_INFINITY};for(let r=0;r<i.length/3;r+=1){let n=[0,1,2].reduce((o,s)=>o+(i[3*r+s]-e[s])**2,0);n<t.distance&&(t={vertex:r,distance:n})}return t.vertex}function at(i,e){let t=new Float32Array(i.length),r=(n,o)=>i[3*n+o];for(let n=0;n+2<e.length;n+=3){let[o,s,a]=[e[n],e[n+1],e[n+2]],[d,c,l]=[r(s,0)-r(o,0),r(s,1)-r(o,1),r(s,2)-r(o,2)],[p,f,Pe]=[r(a,0)-r(o,0),r(a,1)-r(o,1),r(a,2)-r(o,2)];for(let w of[o,s,a])t[3*w]=t[3*w]+c*Pe-l*f,t[3*w+1]=t[3*w+1]+l*p-d*Pe,t[3*w+2]=t[3*w+2]+d*f-c*p}for(let n=0;n<t.length;n+=3){let o=Math.hypot(...t.subarray(n,n+3))||1;for(let s=0;s<3;s+=1)t[n+s]=t[n+s]/o}return t}var lt=15770462;function ht(i){return i?.clone()??new cr({color:12172998})}import{Box3 as ur,Group as fr,Line2 as mr,LineGeometry as yr,LineMaterial as br,Vector3 as be}from"./vendor.js";var ge={chosen:4,other:2},Y=class{group=new fr;lines=new Map;views=new Map;constructor(e,t,r){for(let n of e){let o=t.get(n.id??0);if(o===void 0)continue;let s=C(n.kind??""),a=r*(s.line==="dotted"?.003:.012),d=new br({color:s.color,linewidth:ge.other,dashed:s.line!=="solid",dashSize:a,gapSize:s.line==="dotted"?2*a:.7*a}),c=new yr;c.setPositions([...o.points,...o.points.subarray(0,3)]);let l=new mr(c,d);l.computeLineDistances(),this.lines.set(n.id??0,l),this.views.set(n.id??0,gr(o,n.kind)),this.group.add(l)}}choose(e){for(let[t,r]of this.lines)r.material.linewidth=e.has(t)?ge.chosen:ge.other}viewOf(e){return this.views.get(e)}dispose(){for(let e of this.lines.values())e.geometry.dispose(),e.material.dispose()}};function gr({points:i},e){let t=Array.from({length:i.length/3},(s,a)=>new be().fromArray(i,3*a)),r=new ur().setFromPoints(t),n=r.getCenter(new be),o=new be;return t.forEach((s,a)=>{let d=t[(a+1)%t.length];o.add(s.clone().sub(n).cross(d.clone().sub(n)))}),{bounds:r,front:e==="HOLE"?o.negate().normalize():o.normalize()}}var Lr={shading:"textured",tinted:!0,before:!1,split:0},X=class{constructor(e){this.host=e;this.renderer=new Mr({antialias:!0,alpha:!0}),this.renderer.setPixelRatio(Math.min(devicePixelRatio,2)),this.canvas.tabIndex=0,e.append(this.canvas),this.controls=new kr(this.camera,this.canvas),this.controls.enableDamping=!1,this.controls.addEventListener("change",()=>this.draw());let t=new wr(16777215,1.9);t.position.set(1,1.2,.9),this.camera.add(t),this.scene.add(this.camera,new xr(16777215,9279397,1),this.marks.group),this.resized=new ResizeObserver(()=>this.resize()),this.resized.observe(e),this.canvas.addEventListener("webglcontextrestored",()=>this.draw()),this.resize()}host;camera=new Pr(35,1,.01,100);controls;marks=new z;renderer;scene=new Sr;raycaster=new $r;resized;scan;rims;patches=[];wanted=[];look=Lr;sphere;frameAsked=0;get canvas(){return this.renderer.domElement}get rendererName(){let e=this.renderer.getContext(),t=e.getExtension("WEBGL_debug_renderer_info");return String(e.getParameter(t?.UNMASKED_RENDERER_WEBGL??e.RENDERER))}async showScan(e,t){let r=await q.load(e.slice(0));this.clear(),this.scan=r,this.scene.add(r.root),r.setShading(this.look.shading);let n=r.bounds.getBoundingSphere(new ve);this.lookAt(r.bounds,new M(.5,.5,1));let o=await r.boundaryLines();if(this.scan!==r)return;this.rims=new Y(t,rt(t,o),n.radius||1),this.scene.add(this.rims.group);let s=N(t)[0]?.[1][0]?.id??0;this.lookAt(r.bounds,this.rims.viewOf(s)?.front??new M(.5,.5,1)),r.buildTrees().catch(()=>{})}chooseLoops(e){this.rims?.choose(e),this.draw()}async showPatches(e){this.wanted=e;let t=e[0]?.dressing;if(!this.showsSurfacesOf(e)){let r=t===void 0?[]:await ct(t.glb.slice(0));if(this.wanted[0]?.dressing!==t)return;this.showsSurfacesOf(this.wanted)||this.replacePatches(r)}this.wanted.forEach((r,n)=>{this.patches[n]?.shown!==r&&this.patches[n]?.update(r)}),this.draw()}setLook(e){let t=this.look;if(this.look={...t,...e},t.shading!==this.look.shading&&this.scan?.setShading(this.look.shading),t.shading!==this.look.shading||t.tinted!==this.look.tinted)for(let r of this.patches)r.mesh.material.dispose(),r.mesh.material=this.materialOf(r.shown);this.draw()}frame(e){let t=e===void 0?void 0:this.rims?.viewOf(e);this.lookAt(t?.bounds??this.scan?.bounds??new vr,t?.front??new M)}pivotAt(e){this.controls.target.copy(e),this.controls.update(),this.draw()}pick(e,t){this.aim(e,t);let r=this.look.before?[]:this.patches,n=this.raycaster.intersectObjects(r.map(({mesh:s})=>s),!1)[0],o=this.scan?.pick(this.raycaster);if(n!==void 0&&n.distance<=(o?.distance??Number.POSITIVE_INFINITY)){let s=this.patches.find(({mesh:a})=>a===n.object);return{position:n.point,cloth:s?.pointOf(n)}}return o&&{position:o.point,cloth:void 0}}onScreenPlane(e,t,r){this.aim(e,t);let n=new Ar().setFromNormalAndCoplanarPoint(this.camera.getWorldDirection(new M),r);return this.raycaster.ray.intersectPlane(n,new M)??void 0}onLine(e,t,r,n){this.aim(e,t);let{origin:o,direction:s}=this.raycaster.ray,a=r.clone().sub(o),d=n.dot(s),c=(d*s.dot(a)-n.dot(a))/Math.max(1-d*d,1e-6);return r.clone().addScaledVector(n,c)}draw(){this.frameAsked===0&&(this.frameAsked=requestAnimationFrame(()=>{this.frameAsked=0,this.drawNow()}))}dispose(){cancelAnimationFrame(this.frameAsked),this.clear(),this.resized.disconnect(),this.controls.dispose(),this.renderer.dispose(),this.canvas.remove()}drawNow(){this.fitDepth(),this.marks.fit(this.camera,this.host.clientHeight);let{clientWidth:e,clientHeight:t}=this.host,r=Math.round(this.look.split*e);this.renderer.setScissorTest(r>0),this.drawPart(r>0?[r,e-r]:[0,e],t,!this.look.before),r>0&&this.drawPart([0,r],t,!1)}drawPart([e,t],r,n){this.look.split>0&&this.renderer.setScissor(e,0,t,r),this.patches.forEach(({mesh:o})=>o.visible=n),this.renderer.render(this.scene,this.camera),this.patches.forEach(({mesh:o})=>o.visible=!0)}lookAt(e,t){let{center:r,radius:n}=e.getBoundingSphere(new ve);if(e.isEmpty()||!(n>0))return;let o=Math.min(1,this.camera.aspect),s=1.1*n/Math.sin(this.camera.fov*Math.PI/360)/o,a=t.lengthSq()>0?t.clone():this.camera.position.clone().sub(this.controls.target);this.controls.target.copy(r),this.camera.position.copy(r).addScaledVector(a.normalize(),s),this.fitDepth(),this.controls.update(),this.draw()}aim(e,t){let{left:r,top:n,width:o,height:s}=this.canvas.getBoundingClientRect(),a=new Er((e-r)/o*2-1,1-(t-n)/s*2);this.camera.updateMatrixWorld(),this.raycaster.setFromCamera(a,this.camera)}materialOf({hole:e}){let{shading:t,tinted:r}=this.look;return r?K(lt,t):t!=="textured"?K(12172998,t):ht(this.scan?.materialNear(new M().fromArray(e.rimPositions??[0,0,0])))}fitDepth(){if(this.scan!==void 0){this.sphere??=this.scan.bounds.getBoundingSphere(new ve);let{center:e,radius:t}=this.sphere,r=this.camera.position.distanceTo(e);this.camera.far=r+4*t,this.camera.near=Math.max(r-4*t,this.camera.far/5e3),this.camera.updateProjectionMatrix()}}resize(){let{clientWidth:e,clientHeight:t}=this.host;e>0&&t>0&&(this.renderer.setSize(e,t),this.camera.aspect=e/t,this.camera.updateProjectionMatrix(),this.drawNow())}clear(){this.clearPatches(),this.marks.clear(),this.scan!==void 0&&(this.scene.remove(this.scan.root),this.scan.dispose()),this.rims!==void 0&&(this.scene.remove(this.rims.group),this.rims.dispose()),this.scan=void 0,this.rims=void 0,this.sphere=void 0}showsSurfacesOf(e){let t=(r,n)=>this.patches[n]?.shown.dressing===r.dressing;return e.length===this.patches.length&&e.every(t)}replacePatches(e){this.clearPatches(),this.wanted.forEach((t,r)=>{let n=e[r];if(n!==void 0){let o=new J(t,n,this.materialOf(t));this.patches.push(o),this.scene.add(o.mesh)}})}clearPatches(){for(let e of this.patches)this.scene.remove(e.mesh),e.mesh.material.dispose(),e.dispose();this.patches=[]}};import{css as Tr,html as Or}from"./vendor.js";var we=class extends h{static styles=[h.styles,Tr`
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
    `].flat();viewer;gestures;opened=()=>{this.show()};connectedCallback(){super.connectedCallback(),this.editor.addEventListener("opened",this.opened)}disconnectedCallback(){super.disconnectedCallback(),this.editor.removeEventListener("opened",this.opened),this.gestures?.dispose(),this.viewer?.dispose(),this.viewer=void 0}render(){return Or`<div id="host"></div>`}firstUpdated(){let e=this.renderRoot.querySelector("#host");if(e===null)return;try{this.viewer=new X(e),this.gestures=new G(this.viewer,this.editor)}catch(r){this.editor.report(new Error(`This browser draws no 3-D pictures (WebGL 2): ${String(r)}`));return}let{canvas:t}=this.viewer;t.setAttribute("role","img"),t.setAttribute("aria-label","The scan. Drag to turn it, two fingers or the right button to move it, F to see all."),t.addEventListener("dblclick",r=>{let n=this.viewer?.pick(r.clientX,r.clientY);n!==void 0&&this.viewer?.pivotAt(n.position)})}updated(){this.viewer?.chooseLoops(this.editor.chosen),this.viewer?.showPatches(this.editor.patches),this.viewer?.marks.show(et(this.editor,this.gestures?.waitingPoint))}async show(){let{scan:e}=this.editor;if(e!==void 0)try{await this.viewer?.showScan(e.bytes,e.loops),this.requestUpdate()}catch(t){this.editor.report(new Error(`The scan was read by the service, but cannot be drawn: ${String(t)}`))}}};customElements.define("darn-stage",we);import{css as Cr,html as u,nothing as Q}from"./vendor.js";var Z=[{tool:"look",name:"Look",key:"L",help:"Drag to turn the scan, right button or two fingers to move it, wheel to zoom."},{tool:"grab",name:g.grab,key:"G",help:"Drag new cloth in the plane of the screen; hold Shift to pull it along its normal, or X, Y or Z along an axis."},{tool:"twist",name:g.twist,key:"T",help:"Drag to the left or right on new cloth to turn a disk of it; the wheel changes its size."},{tool:"pinch",name:g.pinch,key:"P",help:"Click two points of new cloth, then choose how far to draw them together."},{tool:"anchor",name:g.anchor,key:"A",help:"Drag from the cloth to where it should be, or type the point; the service finds which place of the cloth belongs there."}],Rr=["x","y","z"],xe=class extends h{static styles=[h.styles,Cr`
      .tools {
        margin-bottom: 0.5rem;
      }
      form {
        display: grid;
        grid-template-columns: repeat(3, 1fr);
        gap: 6px;
      }
      label {
        display: block;
        font-size: 12px;
      }
      .wide {
        grid-column: 1 / -1;
      }
      .check {
        display: flex;
        align-items: center;
        gap: 4px;
      }
    `].flat();render(){let{tool:e,step:t}=this.editor,r=Z.find(n=>n.tool===e)?.help??"";return u`
      <h2>Tools</h2>
      <div class="row tools" role="group" aria-label="Tools">
        ${Z.map(n=>u`
            <button
              aria-pressed=${n.tool===e}
              aria-keyshortcuts=${n.key}
              title="${n.name} (${n.key})"
              ?disabled=${t.patches.length===0&&n.tool!=="look"}
              @click=${()=>this.editor.setTool(n.tool)}
            >
              ${n.name}
            </button>
          `)}
      </div>
      <p class="quiet small">${t.patches.length===0?"Mend a hole to edit its new cloth.":r}</p>
      ${e==="look"||t.patches.length===0?Q:this.form(this.draftOf(e))}
    `}draftOf(e){let{draft:t,step:r}=this.editor,[n]=r.patches;return t?.kind===e?t:n&&ne(e,n)}form(e){if(e===void 0)return Q;let{work:t}=this.editor,r=t!==void 0;return u`
      <form @submit=${n=>this.apply(n,e)}>
        ${this.holeField(e)} ${this.fields(e)}
        <div class="row wide">
          <button class="main" ?disabled=${r}>${e.kind==="anchor"?"Find its place":"Apply"}</button>
          <button type="button" ?disabled=${this.editor.draft===void 0} @click=${()=>this.editor.dropDraft()}>
            Cancel
          </button>
          ${e.kind==="anchor"?u`<button type="button" ?disabled=${r} @click=${()=>this.editor.findAnchor(e,!0)}>
                  Draw the map
                </button>`:Q}
        </div>
      </form>
    `}holeField(e){let{patches:t}=this.editor.step;return t.length<2?Q:u`
      <label class="wide">
        Hole
        <select @change=${n=>{let o=Number(n.target.value),s=t.find(({hole:a})=>a.id===o);s!==void 0&&this.preview(e.kind==="anchor"?{...e,hole:o}:ne(e.kind,s))}}>
          ${t.map(({hole:n})=>u`<option value=${n.id} ?selected=${n.id===e.hole}>${n.id}</option>`)}
        </select>
      </label>
    `}fields(e){switch(e.kind){case"grab":return this.grabFields(e);case"twist":return this.twistFields(e);case"pinch":return this.pinchFields(e);case"anchor":return this.anchorFields(e)}}grabFields(e){return u`
      ${this.uvFields(e.uv,"",t=>({...e,uv:t}))}
      <span></span>
      ${this.vectorFields("Move",e.offset,t=>({...e,offset:t}))}
    `}twistFields(e){let t=e.angle*180/Math.PI;return u`
      ${this.uvFields(e.uv,"",r=>({...e,uv:r}))}
      ${this.number("Radius",e.radius,r=>({...e,radius:r}))}
      ${this.vectorFields("Axis",e.axis,r=>({...e,axis:r}))}
      ${this.number("Angle in degrees",t,r=>({...e,angle:r*Math.PI/180}))}
    `}pinchFields(e){let[t,r]=e.uvs,n=o=>{this.preview({...e,amount:Number(o.target.value)})};return u`
      ${this.uvFields(t,"First ",o=>({...e,uvs:[o,r]}))}
      <span></span>
      ${this.uvFields(r,"Second ",o=>({...e,uvs:[t,o]}))}
      <span></span>
      <label class="wide">
        Share of their distance to take away: ${Math.round(e.amount*100)} %
        <input type="range" min="0" max="1" step="0.01" .value=${String(e.amount)} @input=${n} />
      </label>
    `}anchorFields(e){let t=r=>{this.preview({...e,hard:r.target.checked})};return u`
      ${this.vectorFields("Point",e.position,r=>({...e,position:r}))}
      <label class="wide check">
        <input type="checkbox" .checked=${e.hard} @change=${t} />
        Hard: refuse it where the cloth cannot reach it
      </label>
    `}uvFields([e,t],r,n){return[this.number(`${r}u`,e,o=>n([o,t])),this.number(`${r}v`,t,o=>n([e,o]))]}vectorFields(e,t,r){return Rr.map((n,o)=>this.number(`${e} ${n}`,t[o],s=>r(t.with(o,s))))}number(e,t,r){let n=o=>{let s=o.target.valueAsNumber;Number.isFinite(s)&&this.preview(r(s))};return u`
      <label>
        ${e}
        <input type="number" step="any" .value=${String(Number(t.toPrecision(6)))} @change=${n} />
      </label>
    `}preview(e){this.editor.preview(e)}apply(e,t){e.preventDefault(),this.editor.preview(t),this.editor.commit()}};customElements.define("darn-tools",xe);var Fr=/\.(glb|gltf)$/i,ke=class extends Dr{static styles=[H,Ur`
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
      }
      .problem p {
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
    `];editor=new B(new V(new URL(".",document.baseURI)));dragging=!1;changed=()=>this.requestUpdate();connectedCallback(){super.connectedCallback(),this.editor.addEventListener("change",this.changed),addEventListener("dragover",this.dragOver),addEventListener("dragleave",this.dragLeave),addEventListener("drop",this.drop),addEventListener("keydown",this.keyDown),addEventListener("keyup",this.keyUp),addEventListener("hashchange",this.openNamed),this.openNamed()}disconnectedCallback(){super.disconnectedCallback(),this.editor.removeEventListener("change",this.changed),removeEventListener("dragover",this.dragOver),removeEventListener("dragleave",this.dragLeave),removeEventListener("drop",this.drop),removeEventListener("keydown",this.keyDown),removeEventListener("keyup",this.keyUp),removeEventListener("hashchange",this.openNamed)}render(){let{editor:e}=this,{scan:t,work:r}=e;return L`
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
        ${t===void 0&&r===void 0?this.welcome():pt} ${this.notices()}
      </main>
      <aside @darn-frame=${this.frame} @darn-look=${this.look}>
        ${t===void 0?L`<p class="quiet">The holes of the scan will be listed here.</p>`:L`
                <darn-holes .editor=${e}></darn-holes>
                <darn-tools .editor=${e}></darn-tools>
                <darn-chart .editor=${e}></darn-chart>
                <darn-look .editor=${e}></darn-look>
                <darn-report .editor=${e}></darn-report>
                <darn-constraints .editor=${e}></darn-constraints>
              `}
      </aside>
      <div class="hidden" role="status" aria-live="polite">${e.work?.label??e.message}</div>
    `}welcome(){return L`
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
    `}notices(){let{work:e,problem:t}=this.editor;return t!==void 0?L`
        <div class="notice problem" role="alert">
          <p>${t}</p>
          <button @click=${()=>this.editor.clearProblem()}>Close</button>
        </div>
      `:e===void 0?pt:L`
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
    `}get stage(){return this.renderRoot.querySelector("darn-stage")}pick=()=>this.renderRoot.querySelector("#file")?.click();picked=e=>{let t=e.target;this.openFiles([...t.files??[]]),t.value=""};openFiles(e){let t=e.find(r=>Fr.test(r.name))??e[0];t!==void 0&&this.editor.open(t,t.name)}openExample=()=>{this.editor.openAddress(new URL("editor/scarf_hole.glb",document.baseURI))};openNamed=()=>{let e=new URLSearchParams(location.hash.slice(1)).get("scan");if(e!==null)try{this.editor.openAddress(new URL(e,document.baseURI))}catch{this.editor.report(new Error(`${e} is not an address.`))}};save=async()=>{let e=await this.editor.result();if(e!==void 0){let t=this.editor.scan?.name??"scan.glb";j(e,t.replace(/(\.[a-z]+)?$/i,r=>`.mended${r||".glb"}`))}};dragOver=e=>{e.preventDefault(),this.setDragging(!0)};dragLeave=()=>this.setDragging(!1);drop=e=>{e.preventDefault(),this.setDragging(!1),this.openFiles([...e.dataTransfer?.files??[]])};setDragging(e){this.dragging=e,this.requestUpdate()}frame=e=>this.stage?.viewer?.frame(e.detail);look=e=>this.stage?.viewer?.setLook(e.detail);keyDown=e=>{let t=e.key.toLowerCase();if((e.ctrlKey||e.metaKey)&&(t==="z"||t==="y")&&!ut(e)){e.preventDefault(),t==="y"||e.shiftKey?this.editor.redo():this.editor.undo();return}if(e.ctrlKey||e.metaKey||e.altKey||ut(e))return;let r=Z.find(n=>n.key.toLowerCase()===t)?.tool;r!==void 0&&(r==="look"||this.editor.step.patches.length>0)?this.editor.setTool(r):t==="f"?this.stage?.viewer?.frame():t==="b"&&this.stage?.viewer?.setLook({before:!0})};keyUp=e=>{e.key.toLowerCase()==="b"&&this.stage?.viewer?.setLook({before:!1})}};function ut(i){let e=i.composedPath()[0];return e instanceof HTMLTextAreaElement||e instanceof HTMLInputElement&&!["checkbox","radio","range","button"].includes(e.type)}customElements.define("darn-editor",ke);
