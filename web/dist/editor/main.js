var $=class{running;waiting;offer(e){if(this.running!==void 0){this.waiting=e;return}this.running=this.run(e)}async settled(){this.waiting=void 0,await this.running}async run(e){for(let t=e;t!==void 0;)await t(),t=this.waiting,this.waiting=void 0;this.running=void 0}};var u=class extends Error{constructor(t,r,n,i){super(n);this.status=t;this.code=r;this.retryAfter=i}status;code;retryAfter;name="ProblemError";get keyIsRefused(){return this.status===401}get sessionIsGone(){return this.status===410||this.code==="session_not_found"}};function W(o,e,t){let r=Number(e??Number.NaN),n=Number.isFinite(r)&&r>=0?r:void 0;try{let i=JSON.parse(t),s=(i.errors??[]).map(a=>`
${a.pointer??""} ${a.detail}`);return new u(o,i.code,i.detail+s.join(""),n)}catch{return new u(o,"",`The service answered with status ${o}.`,n)}}function ce(o){return o instanceof u?We(o.message):o instanceof TypeError&&/fetch|network/i.test(o.message)?"The service cannot be reached.":We(o instanceof Error?o.message:String(o))}function U(o){return o instanceof DOMException&&o.name==="AbortError"}function We(o){let e=o.charAt(0).toUpperCase()+o.slice(1);return/[.!?]$/.test(e)?e:`${e}.`}var F=class o{constructor(e,t,r,n){this.service=e;this.scan=t;this.selection=r;this.opened=n}service;scan;selection;opened;live=new $;met;static async open(e,t,r={},n={}){return new o(e,t,r,await e.openSession(t,r,n))}get holes(){return this.opened.holes??[]}get skipped(){return this.opened.skipped??[]}drag(e,{onPatches:t,onError:r}){this.live.offer(async()=>{try{t(await this.positions(e))}catch(n){r(n)}})}async release(e,t={}){return await this.live.settled(),this.mend(e,t)}positions(e,t={}){return this.within(t,async r=>{let n=await this.service.positions(r,e,t);return this.met=JSON.stringify(e),this.byHole(n)})}mend(e,t={}){return this.within(t,async r=>{let{positions:n,report:i}=await this.service.mend(r,e,t);return this.met=JSON.stringify(e),{patches:this.byHole(n),report:i}})}patches(e,t={}){return this.within(t,r=>this.service.patches(r,e,t))}optimizeAnchor(e,t={}){return this.within(t,r=>this.service.optimizeAnchor(r,e,t))}result(e,t={}){return this.within(t,async r=>(this.met!==JSON.stringify(e)&&(await this.service.mend(r,e,t),this.met=JSON.stringify(e)),this.service.result(r,t)))}close(){this.service.close(this.id)}get id(){return this.opened.id??""}async within(e,t){try{return await t(this.id)}catch(r){if(!(r instanceof u&&r.sessionIsGone))throw r;return this.met=void 0,this.opened=await this.service.openSession(this.scan,this.selection,e),t(this.id)}}byHole(e){let t=0;return this.holes.map(r=>{let n=t+3*Nt(r),i=e.subarray(t,n);return t=n,{hole:r,positions:i}})}};function Nt({patchUvs:o=[],patchFaces:e=[]}){return o.length>0?o.length/2:e.reduce((t,r)=>Math.max(t,r+1),0)}async function*qe(o,e){let t=o.getReader(),r=new TextDecoder,[n,i,s]=["","",[]];try{for(;;){let{done:a,value:d}=await It(t.read(),e);if(a)return;n+=r.decode(d,{stream:!0});let l=n.split(/\r\n|\n|\r(?!$)/);n=l.pop()??"";for(let c of l){if(c===""){s.length>0&&(yield{id:i,data:s.join(`
`)}),s=[];continue}let[,h,f]=/^([^:]*)(?:: ?(.*))?$/.exec(c)??[];h==="data"?s.push(f??""):h==="id"&&(i=f??"")}}}finally{t.cancel().catch(()=>{})}}function It(o,e){return new Promise((t,r)=>{let n=setTimeout(()=>r(new Error("The service says nothing any more.")),e);o.then(t,r).finally(()=>clearTimeout(n))})}var Bt=5,jt=60;function Ge(o,e={}){return typeof XMLHttpRequest>"u"?he(o.url,{method:"POST",headers:o.headers,body:o.body},e):Ke(e,()=>Ht(o,e))}function he(o,e,t={}){return Ke(t,async()=>{let r=await pe(o,{...e,signal:t.signal??null});return{contentType:r.headers.get("content-type")??"",body:await r.arrayBuffer()}})}async function pe(o,e){let t=await fetch(o,e);if(!t.ok)throw W(t.status,t.headers.get("retry-after"),await t.text());return t}function m(o){return JSON.parse(new TextDecoder().decode(o.body))}async function Ke(o,e){for(let t=1;;t+=1)try{return await e()}catch(r){let n=r instanceof u&&r.status===503?r.retryAfter:void 0;if(n===void 0||n>jt||t===Bt)throw r;o.onWait?.(n),await ue(n,o.signal)}}function ue(o,e){return new Promise((t,r)=>{let n=()=>{clearTimeout(i),r(new DOMException("stopped","AbortError"))},i=setTimeout(()=>{e?.removeEventListener("abort",n),t()},o*1e3);e?.aborted&&n(),e?.addEventListener("abort",n,{once:!0})})}function Ht({url:o,headers:e,body:t},{onSent:r,signal:n}){return new Promise((i,s)=>{let a=new XMLHttpRequest;a.open("POST",o);for(let[d,l]of Object.entries(e))a.setRequestHeader(d,l);a.responseType="arraybuffer",a.upload.onprogress=d=>{d.lengthComputable&&d.total>0&&r?.(d.loaded/d.total)},a.onload=()=>{let d=a.response;if(a.status<400)i({contentType:a.getResponseHeader("content-type")??"",body:d});else{let l=new TextDecoder().decode(d);s(W(a.status,a.getResponseHeader("retry-after"),l))}},a.onerror=()=>s(new Error("The service cannot be reached, or it closed the connection.")),a.onabort=()=>s(new DOMException("stopped","AbortError")),n?.addEventListener("abort",()=>a.abort()),a.send(t)})}var Vt=45e3,fe={first:.5,longest:30},N=class{constructor(e){this.transport=e}transport;async submit(e,t,r={},n={}){let i=new FormData;i.append("scan",e,"scan"),i.append("constraints",new Blob([JSON.stringify(t)],{type:"application/json"}),"constraints");let{name:s,priority:a,webhook:d,idempotencyKey:l=crypto.randomUUID()}=r,c=`jobs${_e({name:s,priority:a,webhook:d})}`;return m(await this.transport.upload(c,i,n,{"idempotency-key":l}))}async get(e,t={}){return m(await this.transport.send(A(e),{},t))}async list({state:e,from:t,limit:r}={},n={}){return m(await this.transport.send(`jobs${_e({state:e,from:t,limit:r})}`,{},n))}async result(e,t={}){let r=await this.transport.send(A(e,"result"),{},t);return new Blob([r.body],{type:r.contentType})}async report(e,t={}){return m(await this.transport.send(A(e,"report"),{},t))}async cancel(e,t={}){return m(await this.transport.send(A(e,"cancel"),{method:"POST"},t))}async retry(e,t={}){return m(await this.transport.send(A(e,"retry"),{method:"POST"},t))}async delete(e,t={}){await this.transport.send(A(e),{method:"DELETE"},t)}async*events(e,{lastVersion:t,signal:r}={}){let n=t;for(let i=fe.first;;){try{let s=await this.transport.open(A(e,"events"),{headers:n===void 0?{}:{"last-event-id":String(n)},signal:r??null});if(s.status===204||s.body===null)return;for await(let a of qe(s.body,Vt)){let d=JSON.parse(a.data);if([n,i]=[d.version,fe.first],yield d,me(d))return}}catch(s){if(U(s)||r?.aborted||s instanceof u&&!zt(s))throw s;i=Math.max(i,s instanceof u&&s.retryAfter||0)}await ue(i,r),i=Math.min(2*i,fe.longest)}}async wait(e,{onChange:t,...r}={}){for await(let n of this.events(e,r))if(t?.(n),me(n))return n;return this.get(e,r)}};function me(o){return o.state==="DONE"||o.state==="ERROR"||o.state==="CANCELLED"}function zt({status:o}){return o===429||o>=500}function A(o,e){let t=`jobs/${encodeURIComponent(o)}`;return e===void 0?t:`${t}/${e}`}function _e(o){let e=Object.entries(o).filter(([,r])=>r!==void 0),t=new URLSearchParams(e.map(([r,n])=>[r,String(n)])).toString();return t===""?"":`?${t}`}function ye(o,e){let t=/boundary="?([^";]+)"?/.exec(o)?.[1];if(!o.startsWith("multipart/mixed")||t===void 0)throw new Error(`multipart/mixed was asked for, ${o} was answered`);let r=new Uint8Array(e),n=new Map,i=0;for(;;){let s=Wt(r,`\r
\r
`,i);if(s<0){if(!new TextDecoder().decode(r.subarray(i)).startsWith(`--${t}--`))throw new Error("a multipart/mixed answer ends before its last line");return n}let a=new TextDecoder().decode(r.subarray(i,s)).toLowerCase(),d=Number(/content-length: *(\d+)/.exec(a)?.[1]??Number.NaN),l=/name="([^"]*)"/.exec(a)?.[1],c=s+4;if(!a.includes(`--${t.toLowerCase()}`)||l===void 0||!(c+d<=r.length))throw new Error("a part of a multipart/mixed answer cannot be read");let h=/content-type: *([^\r\n;]+)/.exec(a)?.[1]??"";n.set(l,{mediaType:h,body:r.slice(c,c+d)}),i=c+d+2}}function Wt(o,e,t){let r=[...e].map(i=>i.charCodeAt(0)),n=o.length-r.length;for(let i=t;i<=n;i+=1)if(r.every((s,a)=>o[i+a]===s))return i;return-1}function be(o){return{method:"POST",headers:{"content-type":"application/json"},body:JSON.stringify(o)}}var q=class{constructor(e,t){this.base=e;this.options=t;this.key=t.key}base;options;key;asked;send(e,t,r={}){return this.withKey(n=>he(this.at(e),Je(t,n),r))}open(e,t){return this.withKey(r=>pe(this.at(e),Je(t,r)))}upload(e,t,r,n={}){return this.withKey(i=>Ge({url:this.at(e),headers:{...n,...ge(i)},body:t},r))}forget(e,t){fetch(this.at(e),{method:t,keepalive:!0,headers:ge(this.key)}).catch(()=>{})}async withKey(e){for(;;){let t=this.key;try{return await e(t)}catch(r){if(!(r instanceof u&&r.keyIsRefused))throw r;if(this.key===t){let n=await this.ask(r);if(n===void 0)throw r;this.key=n}}}}ask(e){return this.asked??=Promise.resolve(this.options.askForKey?.(e)).finally(()=>this.asked=void 0),this.asked}at(e){return new URL(e,this.base)}};function Je(o,e){return{...o,headers:{...o.headers,...ge(e)}}}function ge(o){return o===void 0?{}:{authorization:`Bearer ${o}`}}var I=class{constructor(e,t={}){this.base=e;this.transport=new q(e,t),this.jobs=new N(this.transport)}base;jobs;transport;async info(){return m(await this.transport.send("info",{}))}async holes(e,t){let r=new FormData;return r.append("scan",e,"scan"),m(await this.transport.upload("holes",r,t))}async openSession(e,t,r){let n=new FormData;return n.append("scan",e,"scan"),n.append("constraints",new Blob([JSON.stringify(t)],{type:"application/json"}),"constraints"),m(await this.transport.upload("sessions",n,r))}async positions(e,t,r){let n=await this.inpaint(e,t,"application/octet-stream",r);return new Float32Array(n.body)}async mend(e,t,r){let i=await this.inpaint(e,t,"multipart/mixed, application/octet-stream;q=0.9",r),{report:s,patches:a}=qt(i);return{report:s,positions:new Float32Array(a.buffer)}}async patches(e,t,r){return(await this.inpaint(e,t,"model/gltf-binary",r)).body}async optimizeAnchor(e,t,r){return m(await this.transport.send(`sessions/${e}/optimize-anchor`,be(t),r))}async result(e,t){let r=await this.transport.send(`sessions/${e}/result`,{},t);return new Blob([r.body],{type:r.contentType})}close(e){this.transport.forget(`sessions/${e}`,"DELETE")}inpaint(e,t,r,n){let i=be(t);return i.headers={...i.headers,accept:r},this.transport.send(`sessions/${e}/inpaint`,i,n)}};function qt(o){let e=ye(o.contentType,o.body),[t,r]=[e.get("report"),e.get("patches")];if(t===void 0||r===void 0)throw new Error("the answer has no report or no patches");return{report:JSON.parse(new TextDecoder().decode(t.body)),patches:r.body}}function B({hole:o}){return(o.patchUvs?.length??0)>0}function v(o,e){if(!B(o))return;let{patchFaces:t=[],patchUvs:r=[],id:n=0}=o.hole,i=s=>[r[2*s],r[2*s+1]];for(let s=0;s+2<t.length;s+=3){let a=t.slice(s,s+3),d=Gt(e,a.map(i));if(d!==void 0)return{hole:n,uv:e,vertices:a,weights:d}}}function M({positions:o},{vertices:e,weights:t}){return[0,1,2].map(r=>e.reduce((n,i,s)=>n+t[s]*o[3*i+r],0))}function T({positions:o},{vertices:e}){let[t,r,n]=e.map(l=>[...o.subarray(3*l,3*l+3)]),[i,s]=[ve(r,t),ve(n,t)],a=[i[1]*s[2]-i[2]*s[1],i[2]*s[0]-i[0]*s[2],i[0]*s[1]-i[1]*s[0]],d=Math.hypot(...a)||1;return a.map(l=>l/d)}function Ye(o){let{rimUvs:e=[]}=o.hole,t=e.length/2||1,r=[0,1].map(s=>e.reduce((a,d,l)=>l%2===s?a+d:a,0)/t),n=o.hole.patchUvs??[],i={uv:r,distance:Number.POSITIVE_INFINITY};for(let s=0;s+1<n.length;s+=2){let a=[n[s],n[s+1]],d=Math.hypot(a[0]-r[0],a[1]-r[1]);d<i.distance&&(i={uv:a,distance:d})}return i.uv}function Xe(o,e){let t;for(let r of o){let n=r.hole.rimPositions??[];for(let i=0;i+2<n.length;i+=3){let s=Math.hypot(...ve(n.slice(i,i+3),e));s<(t?.distance??Number.POSITIVE_INFINITY)&&(t={patch:r,distance:s})}}return t?.patch}function ve(o,e){return[o[0]-e[0],o[1]-e[1],o[2]-e[2]]}function Gt([o,e],[t,r,n]){let i=(r[0]-t[0])*(n[1]-t[1])-(n[0]-t[0])*(r[1]-t[1]);if(i===0)return;let s=((o-t[0])*(n[1]-t[1])-(n[0]-t[0])*(e-t[1]))/i,a=((r[0]-t[0])*(e-t[1])-(o-t[0])*(r[1]-t[1]))/i,d=1-s-a,l=-1e-6;return d>=l&&s>=l&&a>=l?[d,s,a]:void 0}var Qe=new Map([["HOLE",{plural:"Holes",singular:"Hole",color:"#d9480f",line:"solid"}],["OPENING",{plural:"Openings",singular:"Opening",color:"#9c5fd0",line:"dotted"}],["TUBE_END",{plural:"Ends of sleeves",singular:"End of a sleeve",color:"#37a04d",line:"dotted"}],["OUTER_BOUNDARY",{plural:"Borders",singular:"Border",color:"#3f86c9",line:"dashed"}]]);function j(o){let e=o.toLowerCase().replaceAll("_"," "),t=e.charAt(0).toUpperCase()+e.slice(1);return Qe.get(o)??{plural:t,singular:t,color:"#862e9c",line:"dotted"}}function w(o){return o.kind==="HOLE"}function Ze(o){return o.kind!=="OUTER_BOUNDARY"}function G(o){let e=[...Qe.keys()],t=new Map(e.map(n=>[n,[]]));for(let n of o){let i=n.kind??"LOOP_KIND_UNSPECIFIED";t.set(i,[...t.get(i)??[],n])}let r=n=>n.length??0;return[...t].filter(([,n])=>n.length>0).map(([n,i])=>[n,i.sort((s,a)=>r(a)-r(s))])}function y(o){return o===void 0||!Number.isFinite(o)?"\u2013":o!==0&&(Math.abs(o)>=1e6||Math.abs(o)<.001)?o.toExponential(2):String(Number(o.toPrecision(3)))}var et={anchors:[],edits:[]};function tt(o,e){let t=r=>r.hole===void 0||e.has(r.hole);return{anchors:o.anchors.filter(t),edits:o.edits.filter(t)}}function H(o){return{...o.anchors.length>0&&{anchors:[...o.anchors]},...o.edits.length>0&&{edits:[...o.edits]}}}function rt(o,{holes:e,acceptDoubtful:t}){let r=a=>a.id??0,n=o.filter(w).map(r),i=o.filter(a=>!w(a)&&e.includes(r(a))).map(a=>({id:r(a)})),s=n.filter(a=>!e.includes(a));return{...i.length>0&&{holes:i},...i.length>0&&s.length<n.length&&{fill:"holes"},...s.length>0&&{except:s},...t&&{acceptDoubtful:t}}}function nt({holes:o,acceptDoubtful:e},t){return{holes:o.map(r=>({id:r})),...e&&{acceptDoubtful:e},...H(t)}}function ot(o){let e;try{e=JSON.parse(o)}catch(d){throw new Error(`The constraints are not JSON: ${d instanceof Error?d.message:String(d)}`)}if(typeof e!="object"||e===null||Array.isArray(e))throw new Error("The constraints must be a JSON object.");let{holes:t,acceptDoubtful:r=!1,anchors:n=[],edits:i=[],...s}=e,a=Object.keys(s);if(a.length>0)throw new Error(`The editor does not use: ${a.join(", ")}.`);if(!we(n)||!we(i))throw new Error("`anchors` and `edits` must be lists of objects.");if(typeof r!="boolean")throw new Error("`acceptDoubtful` must be true or false.");return{holes:t===void 0?void 0:Kt(t),acceptDoubtful:r,constraints:{anchors:n,edits:i}}}function Kt(o){if(!we(o))throw new Error("`holes` must be a list of objects.");return o.map(e=>{let t=e.id;if(typeof t!="number"||!Number.isInteger(t))throw new Error("The editor reads holes by `id` alone.");return t})}function we(o){return Array.isArray(o)&&o.every(e=>typeof e=="object"&&e!==null)}var x={grab:"Grab",twist:"Twist",pinch:"Pinch",anchor:"Anchor"};function xe(o,e){let t=e.hole.id??0,r=Ye(e),n=v(e,r);switch(o){case"grab":return{kind:o,hole:t,uv:r,offset:[0,0,0]};case"twist":return{kind:o,hole:t,uv:r,radius:.125,axis:n?T(e,n):[0,1,0],angle:0};case"pinch":return{kind:o,hole:t,uvs:[r,[r[0]+.1,r[1]]],amount:.5};case"anchor":return{kind:o,hole:t,position:n?M(e,n):[0,0,0],hard:!1}}}function ke(o,e){return{...o,edits:[...o.edits,_t(e)]}}function it(o,{hole:e,position:t,hard:r},n){let i={hole:e,uv:[...n],position:[...t],...r&&{hard:r}};return{...o,anchors:[...o.anchors,i]}}function _t(o){let{hole:e}=o;switch(o.kind){case"grab":return{hole:e,grab:{uv:[...o.uv],offset:[...o.offset]}};case"twist":return{hole:e,twist:{uv:[...o.uv],radius:o.radius,axis:[...o.axis],angle:o.angle}};case"pinch":return{hole:e,pinch:{uvs:o.uvs.map(t=>[...t]),amount:o.amount}}}}var V=class{states;at=0;constructor(e){this.states=[e]}get present(){return this.states[this.at]}get canUndo(){return this.at>0}get canRedo(){return this.at+1<this.states.length}get next(){return this.states[this.at+1]}push(e){this.states.length=this.at+1,this.states.push(e),this.at+=1}undo(){this.at=Math.max(this.at-1,0)}redo(){this.at=Math.min(this.at+1,this.states.length-1)}};var K=class{constructor(e,t,r){this.service=e;this.scan=t;this.loops=r}service;scan;loops;opened;get skipped(){return this.opened?.cloth.skipped??[]}async mend(e,t,r){let n=await this.open(e,r),{patches:i,report:s}=await n.cloth.mend(t,r);return{patches:at(i,n),report:s}}async preview(e,t){let r=await this.open(e,{});return at(await r.cloth.positions(t),r)}async optimizeAnchor(e,t,r){return(await this.open(e,r)).cloth.optimizeAnchor(t,r)}async result(e,t,r){return(await this.open(e,r)).cloth.result(t,r)}close(){this.opened?.cloth.close(),this.opened=void 0}async open(e,t){let r=st(e);if(this.opened!==void 0&&[this.opened.asked,this.opened.filled].includes(r))return this.opened;let n=await F.open(this.service,this.scan,rt(this.loops,e),t),i=await n.positions({},t),s=await n.patches({},t),a=new Map(i.map(l=>[l.hole.id??0,l.positions]));this.close();let d=st({...e,holes:[...a.keys()]});return this.opened={asked:r,filled:d,cloth:n,dressing:{glb:s,positions:a}},this.opened}};function st({holes:o,acceptDoubtful:e}){return`${o.join()} ${e}`}function at(o,{dressing:e}){return o.map(t=>({...t,dressing:e}))}var dt={label:"Open",holes:[],acceptDoubtful:!1,constraints:et,patches:[],report:void 0},_=class extends EventTarget{constructor(t){super();this.service=t;this.limits=t.info().catch(()=>{})}service;scan;chosen=new Set;acceptDoubtful=!1;skipped=[];tool="look";draft;draftPatches;found;work;problem;message="";history=new V(dt);session;live=new $;limits;get step(){return this.history.present}get editable(){return this.step.patches.filter(B)}get patches(){return this.draftPatches??this.step.patches}get undoLabel(){return this.history.canUndo?this.history.present.label:void 0}get redoLabel(){return this.history.next?.label}reportOf(t){return this.step.report?.holes?.find(r=>r.id===t)}async open(t,r){await this.working(`Sending ${r}`,async n=>{let i=(await this.limits)?.limits.bodyBytes;if(i!==void 0&&t.size+4096>i)throw new Error(`${r} has ${t.size} bytes; this service takes at most ${i}.`);let s=await t.arrayBuffer(),{loops:a=[],notes:d=[]}=await this.service.holes(t,n);this.session?.close(),this.session=new K(this.service,t,a),this.scan={file:t,name:r,bytes:s,loops:a,notes:d},this.history=new V(dt),this.chosen=new Set(a.filter(w).map(c=>c.id??0)),this.skipped=[],this.acceptDoubtful=!1,this.found=void 0,this.dropDraft();let l=this.chosen.size;this.message=`${r} is open: ${l} ${l===1?"hole":"holes"} in ${a.length} boundary loops.`,this.dispatchEvent(new Event("opened"))})}async openAddress(t){let r=decodeURIComponent(t.pathname.split("/").pop()??"")||t.host,n;await this.working(`Loading ${r}`,async({signal:i})=>{let s=await fetch(t,{signal:i??null});if(!s.ok)throw new Error(`${t.href} answered with status ${s.status}.`);n=new Blob([await s.arrayBuffer()],{type:"model/gltf-binary"})}),n!==void 0&&await this.open(n,r)}choose(t){this.chosen=t,this.changed()}setAcceptDoubtful(t){this.acceptDoubtful=t,this.changed()}async mend(){let t=[...this.chosen].sort((s,a)=>s-a),r=`${t.length} ${t.length===1?"hole":"holes"}`,{acceptDoubtful:n}=this,i=tt(this.step.constraints,this.chosen);await this.apply(`Mend ${r}`,{holes:t,acceptDoubtful:n},i,"mended")}preview(t){this.draft=t,this.changed(),t.kind!=="anchor"&&this.live.offer(async()=>{let{step:r,session:n}=this;if(!(this.draft!==t||n===void 0))try{let i=await n.preview(r,H(ke(r.constraints,t)));this.draft!==void 0&&this.step===r&&(this.draftPatches=i,this.changed())}catch(i){this.report(i)}})}async commit(){let{draft:t}=this;if(t!==void 0)if(t.kind==="anchor")await this.placeAnchor(t);else{let r=ke(this.step.constraints,t);await this.apply(x[t.kind],this.step,r)}}dropDraft(){this.draft=void 0,this.draftPatches=void 0,this.changed()}async findAnchor({hole:t,position:r},n){let i;return await this.working(n?"Drawing the map":"Searching",async s=>{let a={hole:t,target:[...r],map:n},d=await this.session?.optimizeAnchor(this.step,a,s);d!==void 0&&(i={hole:t,found:d},this.found=i,this.message=`Found after ${d.evaluations} evaluations of the network.`)}),i}async placeAnchor(t){let r=(await this.findAnchor(t,!1))?.found.uv;if(r!==void 0){let n=it(this.step.constraints,t,r);await this.apply(t.hard?"Hard anchor":x.anchor,this.step,n)}}undo(){this.travel(()=>this.history.undo(),"Undone")}redo(){this.travel(()=>this.history.redo(),"Redone")}setTool(t){this.tool=t,this.dropDraft()}constraintsText(){return JSON.stringify(nt(this.step,this.step.constraints),void 0,2)}async loadConstraints(t){let r;try{r=ot(t)}catch(d){this.report(d);return}let{scan:n,step:i}=this,s=(n?.loops??[]).filter(w).map(d=>d.id??0),a=[...r.holes??(i.holes.length>0?i.holes:s)].sort((d,l)=>d-l);this.acceptDoubtful=r.acceptDoubtful,await this.apply("Load constraints",{holes:a,acceptDoubtful:r.acceptDoubtful},r.constraints),this.choose(new Set(this.step.holes))}async result(){let t;return await this.working("Saving",async r=>{let{holes:n,constraints:i}=this.step;t=await this.session?.result(this.step,H(i),r),this.message=`Saved with ${n.length} filled ${n.length===1?"hole":"holes"}.`}),t}say(t){this.message=t,this.changed()}report(t){U(t)||(this.problem=ce(t),this.changed())}clearProblem(){this.problem=void 0,this.changed()}async apply(t,r,n,i="edited"){await this.working(t,async s=>{if(this.session===void 0||r.holes.length===0)return;let{patches:a,report:d}=await this.session.mend(r,H(n),s);this.skipped=this.session.skipped;let l=a.map(h=>h.hole.id??0),{acceptDoubtful:c}=r;this.history.push({label:t,holes:l,acceptDoubtful:c,constraints:n,patches:a,report:d}),this.message=this.messageOfStep(t,this.history.present),this.dispatchEvent(new Event(i))}),this.dropDraft()}messageOfStep(t,r){let n=r.patches.reduce((i,s)=>i+(s.hole.patchFaces?.length??0)/3,0);return`${t}: ${r.patches.length} filled, ${n.toLocaleString("en")} new triangles.`}travel(t,r){let n=this.step;this.work===void 0&&(t(),this.step!==n&&(this.message=`${r}. Now: ${this.step.label}.`,this.found=void 0,this.problem=void 0),this.dropDraft())}async working(t,r){this.work?.stop.abort();let n=new AbortController,i=(s,a)=>{n.signal.aborted||(this.work={label:s,share:a,stop:n},this.changed())};this.problem=void 0,i(t,void 0);try{await this.live.settled(),await r({signal:n.signal,onSent:s=>i(s<1?t:"Computing",s<1?s:void 0),onWait:s=>i(`The service is busy; waiting ${s} s`,void 0)})}catch(s){this.report(s)}finally{this.work?.stop===n&&(this.work=void 0),this.changed()}}changed(){this.dispatchEvent(new Event("change"))}};var Jt=/\.(glb|gltf)$/i,Yt=[[/\.png$/i,"image/png"],[/\.jpe?g$/i,"image/jpeg"],[/\.webp$/i,"image/webp"]];async function lt(o){let e=o.find(({name:n})=>Jt.test(n))??o[0];if(e===void 0)return;let{name:t}=e;if(!/\.gltf$/i.test(t))return{file:e,name:t};let r;try{r=JSON.parse(await e.text())}catch{return{file:e,name:t}}for(let n of[...r.buffers??[],...r.images??[]])n.uri!==void 0&&!n.uri.startsWith("data:")&&(n.uri=await Qt(Xt(o,n.uri),n));return{file:new Blob([JSON.stringify(r)],{type:"model/gltf+json"}),name:t}}function Xt(o,e){let t=decodeURIComponent(e).split("/").pop(),r=o.find(({name:n})=>n===t);if(r===void 0)throw new Error(`The scan refers to the file ${t}; drop both together.`);return r}async function Qt(o,e){let t=Yt.find(([s])=>s.test(o.name))?.[1],r=e.mimeType??t??"application/octet-stream",n=new Uint8Array(await o.arrayBuffer()),i="";for(let s=0;s<n.length;s+=32768)i+=String.fromCharCode(...n.subarray(s,s+32768));return`data:${r};base64,${btoa(i)}`}import{LitElement as kn,css as Pn,html as D,nothing as Ut}from"./vendor.js";function J(o,e){let t=document.createElement("a");t.href=URL.createObjectURL(o),t.download=e,t.click(),setTimeout(()=>URL.revokeObjectURL(t.href),6e4)}import{css as nr,html as $e,nothing as k,svg as Se}from"./vendor.js";import{svg as Zt}from"./vendor.js";var Pe=64,Y=[[253,231,37],[53,183,121],[49,104,142],[68,1,84]];function ct(o){let e=o.filter(t=>t!==null&&Number.isFinite(t));return e.length===0?void 0:{least:e.reduce((t,r)=>Math.min(t,r)),most:e.reduce((t,r)=>Math.max(t,r))}}function ht(o,{least:e,most:t},r){let n=r/Pe,i=Math.max(t*1e-6,Number.MIN_VALUE),s=l=>Math.log(l+i),[a,d]=[s(e),s(t)];return o.flatMap((l,c)=>{if(l===null||!Number.isFinite(l))return[];let[h,f]=[c%Pe,Math.floor(c/Pe)],P=er(d>a?(s(l)-a)/(d-a):0);return[Zt`<rect x=${h*n} y=${r-(f+1)*n} width=${n} height=${n} shape-rendering="crispEdges" fill=${P} />`]})}function er(o){let e=Math.min(Math.max(o,0),1)*(Y.length-1),t=Math.min(Math.floor(e),Y.length-2),[r,n]=[Y[t],Y[t+1]];return`rgb(${r.map((s,a)=>Math.round(s+(n[a]-s)*(e-t))).join()})`}import{LitElement as rr}from"./vendor.js";import{css as tr}from"./vendor.js";var L=tr`
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
`;var p=class extends rr{static styles=[L];editor;changed=()=>this.requestUpdate();connectedCallback(){super.connectedCallback(),this.editor.addEventListener("change",this.changed)}disconnectedCallback(){super.disconnectedCallback(),this.editor.removeEventListener("change",this.changed)}};var S=256,pt=64,Ee=class extends p{static styles=[p.styles,nr`
      svg {
        display: block;
        width: 100%;
        max-width: 320px;
        border: 1px solid var(--line);
        border-radius: 5px;
      }
    `].flat();render(){let{draft:e,found:t,editable:r}=this.editor,n=e?.hole??t?.hole??r[0]?.hole.id,i=r.find(h=>h.hole.id===n);if(i===void 0)return k;let s=t!==void 0&&t.hole===n?t.found:void 0,a=i.hole.chartPng,d=this.editor.tool==="anchor"?s?.map??[]:[],l=ct(d),c=(s?.path??[]).map(({cell:h})=>or(h??[]));return $e`
      <h2>Chart of hole ${n}</h2>
      <svg viewBox="0 0 ${S} ${S}" role="img" aria-label=${this.words(n??0)}>
        ${a?Se`<image href="data:image/png;base64,${a}" width=${S} height=${S} />`:k}
        ${l?ht(d,l,S):k}
        ${c.length>1?Se`<polyline points=${c.map(h=>ut(h).join()).join(" ")} fill="none" stroke="#0b7285" stroke-width="2" />`:k}
        ${this.placed(n??0).map(h=>Ae(h,"#ffffff"))}
        ${e?ir(e).map(h=>Ae(h,"#22b8cf")):k}
        ${s?.uv?Ae(s.uv,"#ffd43b"):k}
      </svg>
      ${l?$e`<p class="small">
              The map: light where the loss is least (${y(l.least)}), dark where it is largest
              (${y(l.most)}).
            </p>`:k}
      ${s?$e`<p class="small">
              The point belongs at u ${s.uv?.[0]?.toFixed(3)}, v ${s.uv?.[1]?.toFixed(3)}; the search went
              through ${c.length} ${c.length===1?"cell":"cells"}.
            </p>`:k}
    `}placed(e){let{anchors:t,edits:r}=this.editor.step.constraints,n=i=>i.hole===void 0||i.hole===e;return[...t.filter(n).map(({uv:i})=>i),...r.filter(n).flatMap(({grab:i,twist:s,pinch:a})=>[i?.uv,s?.uv,...a?.uvs??[]])].filter(i=>i?.length===2)}words(e){let t=this.placed(e).length;return`The cloth around hole ${e}, laid flat, with ${t} ${t===1?"place":"places"} of constraints.`}};function ut([o,e]){return[o*S,(1-e)*S]}function Ae(o,e){let[t,r]=ut(o);return Se`<circle cx=${t} cy=${r} r="5" fill=${e} stroke="#1c2026" stroke-width="1.5" />`}function or([o=0,e=0]){return[(o+.5)/pt,(e+.5)/pt]}function ir(o){switch(o.kind){case"grab":case"twist":return[o.uv];case"pinch":return o.uvs;case"anchor":return[]}}customElements.define("darn-chart",Ee);import{html as sr}from"./vendor.js";var Me=class extends p{render(){let{work:e}=this.editor;return sr`
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
    `}get field(){return this.renderRoot.querySelector("textarea")}copy=async()=>{let e=this.field?.value??"";try{await navigator.clipboard.writeText(e)}catch{this.field?.select(),document.execCommand("copy")}this.editor.say("Copied.")};load=()=>{this.editor.loadConstraints(this.field?.value??"")}};customElements.define("darn-constraints",Me);import{css as ar,html as b,nothing as X,svg as dr}from"./vendor.js";var lr=new Set(["not_selected","excepted","outer_boundary","tube_end","opening"]),Te=class extends p{static styles=[p.styles,ar`
      ul {
        margin: 0 0 0.75rem;
        padding: 0;
        list-style: none;
        max-height: 18rem;
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
      .doubtful {
        display: flex;
        align-items: center;
        gap: 4px;
        margin-bottom: 6px;
      }
      .why {
        grid-column: 2 / -1;
        padding: 0 10px 4px;
      }
      svg {
        vertical-align: middle;
        margin-right: 6px;
      }
    `].flat();lastClicked;render(){let{scan:e,chosen:t,work:r}=this.editor,n=e?.loops??[],i=n.filter(w).map(s=>s.id??0);return b`
      <h2>Holes</h2>
      ${G(n).map(([s,a])=>this.group(s,a))}
      ${i.length===0?b`<p>This scan has no holes to fill.</p>`:X} ${this.doubtful()}
      <div class="row">
        <button class="main" id="mend" ?disabled=${t.size===0||r!==void 0} @click=${this.mend}>
          Mend ${t.size===1?"1 hole":`${t.size} holes`}
        </button>
        <button ?disabled=${i.length===0} @click=${()=>this.editor.choose(new Set(i))}>All</button>
        <button ?disabled=${t.size===0} @click=${()=>this.editor.choose(new Set)}>None</button>
      </div>
    `}doubtful(){let{skipped:e,acceptDoubtful:t}=this.editor;return!t&&!e.some(({code:n})=>n==="no_plausible_fill")?X:b`
      <label class="doubtful">
        <input type="checkbox" .checked=${t} @change=${n=>this.editor.setAcceptDoubtful(n.target.checked)} />
        Mend with doubtful cloth, too
      </label>
    `}group(e,t){let r=j(e),n={solid:"",dashed:"7 4",dotted:"2 4"}[r.line],i=dr`<svg width="30" height="8" aria-hidden="true">
      <line x1="0" y1="4" x2="30" y2="4" stroke=${r.color} stroke-width="3" stroke-dasharray=${n} />
    </svg>`;return b`
      <h3>${i}${r.plural} (${t.length})</h3>
      <ul aria-label=${r.plural}>
        ${t.map(s=>this.item(s,t))}
      </ul>
    `}item(e,t){let r=e.id??0,{step:n,skipped:i,chosen:s}=this.editor,a=n.holes.includes(r),d=i.find(c=>c.id===r&&!lr.has(c.code??"")),l=`${j(e.kind??"").singular} ${r}`;return b`
      <li>
        ${Ze(e)?b`<input
                type="checkbox"
                aria-label="Choose ${l}"
                .checked=${s.has(r)}
                @click=${c=>this.toggle(c,r,t)}
              />`:b`<span></span>`}
        <button @click=${()=>this.frame(r)} aria-label="Show ${l}, length ${y(e.length)}">
          ${l}${a?" \u2713 mended":""}
        </button>
        <span class="quiet small">${y(e.length)} · ${e.vertices} vertices</span>
        ${cr(e)} ${d?b`<span class="why quiet small">Left open: ${d.reason}.</span>`:X}
      </li>
    `}toggle(e,t,r){let n=r.map(c=>c.id??0),i=new Set(this.editor.chosen),[s,a]=[n.indexOf(this.lastClicked??t),n.indexOf(t)],d=e.shiftKey&&s>=0?n.slice(Math.min(s,a),Math.max(s,a)+1):[t],l=e.target.checked;for(let c of d)l?i.add(c):i.delete(c);this.lastClicked=t,this.editor.choose(i)}frame(e){this.dispatchEvent(new CustomEvent("darn-frame",{detail:e,bubbles:!0,composed:!0}))}mend=()=>{this.editor.mend()}};function cr({confidence:o=0,evidence:e=[]}){if(e.length===0)return X;let t=[...e].sort((r,n)=>Math.abs(n.weight??0)-Math.abs(r.weight??0));return b`
    <details class="why quiet small">
      <summary>${Math.round(o*100)} % sure</summary>
      ${t.map(({reason:r})=>b`<p>${r}</p>`)}
    </details>
  `}customElements.define("darn-holes",Te);import{LitElement as hr,css as pr,html as ur}from"./vendor.js";var Q=class{name;constructor(e){this.name=`darn key ${e.href}`}get kept(){try{return sessionStorage.getItem(this.name)??void 0}catch{return}}keep(e){try{e===void 0?sessionStorage.removeItem(this.name):sessionStorage.setItem(this.name,e)}catch{}}},Le=class extends hr{static styles=[L,pr`
      dialog {
        width: min(30rem, 90vw);
        border: 1px solid var(--line);
        border-radius: 6px;
        background: var(--surface);
        color: inherit;
      }
      h2 {
        margin-top: 0;
      }
      input {
        width: 100%;
        box-sizing: border-box;
        margin-bottom: 0.75rem;
      }
    `];answer;ask(){return this.settle(void 0),this.field.value="",this.dialog.showModal(),new Promise(e=>this.answer=e)}render(){return ur`
      <dialog aria-labelledby="title" @close=${()=>this.settle(void 0)}>
        <form @submit=${this.submit}>
          <h2 id="title">This service takes a key</h2>
          <p>Whoever runs the service gives keys. It is kept until this tab is closed.</p>
          <input type="password" aria-label="Key" autocomplete="off" spellcheck="false" placeholder="darn_…" required />
          <div class="row">
            <button class="main" type="submit">Use this key</button>
            <button type="button" @click=${()=>this.settle(void 0)}>Go on without</button>
          </div>
        </form>
      </dialog>
    `}get dialog(){return this.renderRoot.querySelector("dialog")}get field(){return this.renderRoot.querySelector("input")}submit=e=>{e.preventDefault(),this.settle(this.field.value.trim())};settle(e){let{answer:t}=this;this.answer=void 0,this.field.value="",this.dialog.close(),t?.(e)}};customElements.define("darn-key",Le);import{css as fr,html as Re}from"./vendor.js";var mr=[["textured","Textured"],["shaded","Shaded"],["wireframe","Wireframe"]],Ce=class extends p{static styles=[p.styles,fr`
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
    `].flat();render(){return Re`
      <h2>Look</h2>
      <fieldset>
        <legend class="quiet small">Surface</legend>
        <div class="row">
          ${mr.map(([e,t])=>Re`
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
      <div>${this.check("New cloth in its own colour",e=>({tinted:e}))}</div>
      <div>${this.check("Outlines of holes and borders",e=>({outlined:e}))}</div>
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
    `}check(e,t){return Re`<label><input type="checkbox" checked @change=${n=>this.look(t(n.target.checked))} />${e}</label>`}look(e){this.dispatchEvent(new CustomEvent("darn-look",{detail:e,bubbles:!0,composed:!0}))}};customElements.define("darn-look",Ce);var yr="The cloth around it cannot be laid flat: a fair surface without folds, which takes no gestures.";function ft(o){let e=o.patch??{},t=(e.faces??0).toLocaleString("en"),r=[`Hole ${o.id}: ${t} new triangles, area ${y(e.area)}, on a rim of length ${y(o.length)}.`,`${gr(e.stretchMean,e.stretchMax)} ${br(e.selfIntersections??0)}`,e.method==="fair"?yr:vr(e.networkShare)];for(let n of o.anchors??[]){let i=n.beyondReach??0,s=i>0?`; ${y(i)} of that is beyond the cloth's reach`:"";r.push(`An anchor is ${y(n.distance)} away from the cloth${s}.`)}for(let n of o.edits??[])r.push(`A gesture is followed to within ${y(n.distance)}.`);return[...r,...(o.doubts??[]).map(n=>`Doubtful: ${n}.`),...o.notes??[]].filter(n=>n!=="")}function mt(o){let e=o.holes?.length??0,t=o.skipped?.length??0,r=t===1?"1 loop is":`${t} loops are`;return`${yt(e,"hole")} filled; ${r} left open.`}function gr(o,e){return o===void 0||e===void 0?"":`Lengths differ from those of flat cloth by ${Oe(o-1)} on average, ${Oe(e-1)} at most.`}function br(o){return o===0?"No triangles cross.":`${yt(o,"pair")} of triangles cross.`}function vr(o){return o===void 0?"":o>=.995?"The network predicts its folds.":o<=.005?"A fair surface without folds, as the cloth around it has none.":`${Oe(o)} of the network's folds, for the rest a fair surface.`}function Oe(o){return`${Number((Math.abs(o)*100).toPrecision(2))} %`}function yt(o,e){return`${o} ${e}${o===1?"":"s"}`}import{css as wr,html as R,nothing as xr}from"./vendor.js";var De=class extends p{static styles=[p.styles,wr`
      .hole {
        margin-bottom: 0.75rem;
      }
      .hole p {
        margin: 0;
      }
    `].flat();render(){let{report:e}=this.editor.step,t=[...this.editor.scan?.notes??[],...e?.notes??[]];return e===void 0?t.length===0?xr:R`<h2>Notes</h2>
            ${t.map(r=>R`<p>${r}</p>`)}`:R`
      <h2>Report</h2>
      <p>${mt(e)}</p>
      ${[...new Set(t)].map(r=>R`<p>${r}</p>`)}
      ${(e.holes??[]).map(r=>R`<div class="hole">${ft(r).map(n=>R`<p>${n}</p>`)}</div>`)}
      <button
        @click=${()=>J(new Blob([JSON.stringify(e,void 0,2)]),`${this.baseName}.report.json`)}
      >
        Save the report
      </button>
    `}get baseName(){return(this.editor.scan?.name??"scan").replace(/\.(glb|gltf)$/i,"")}};customElements.define("darn-report",De);import{Vector3 as ee}from"./vendor.js";import{BufferAttribute as kr,BufferGeometry as Pr,Group as $r,Line as gt,LineBasicMaterial as Ar,LineLoop as Sr,Mesh as bt,MeshBasicMaterial as Er,SphereGeometry as Mr,Vector3 as Ue}from"./vendor.js";var Tr=7,vt=64,Z=class{group=new $r;ball=new Mr(1,24,16);ballMaterial=new Er({color:750213,depthTest:!1,transparent:!0});lineMaterial=new Ar({color:750213,depthTest:!1,transparent:!0});show({handles:e=[],tethers:t=[],ring:r=[]}){this.clear();for(let n of e){let i=new bt(this.ball,this.ballMaterial);i.position.copy(n),this.group.add(i)}for(let n of t)this.group.add(new gt(wt(n),this.lineMaterial));r.length>0&&this.group.add(new Sr(wt(r),this.lineMaterial)),this.group.children.forEach(n=>n.renderOrder=10)}clear(){for(let e of this.group.children)e instanceof gt&&e.geometry.dispose();this.group.clear()}fit(e,t){let r=2*Math.tan(e.fov*Math.PI/360)/Math.max(t,1);for(let n of this.group.children)n instanceof bt&&n.scale.setScalar(Tr*r*e.position.distanceTo(n.position))}};function xt(o,e,t){let n=(Math.abs(e.x)<.9?new Ue(1,0,0):new Ue(0,1,0)).cross(e).normalize(),i=new Ue().crossVectors(e,n).normalize();return Array.from({length:vt},(s,a)=>{let d=2*Math.PI*a/vt;return o.clone().addScaledVector(n,t*Math.cos(d)).addScaledVector(i,t*Math.sin(d))})}function wt(o){let e=new Float32Array(o.flatMap(t=>t.toArray()));return new Pr().setAttribute("position",new kr(e,3))}var Lr=64;function kt(o,e){let{draft:t}=o,r=t?.hole??e?.hole,n=o.step.patches.find(s=>s.hole.id===r),i=o.patches.find(s=>s.hole.id===r);return n===void 0||i===void 0?{}:t===void 0?e?{handles:[z(i,e)]}:{}:Rr(t,n,i,o.reportOf(t.hole)?.grid?.spacingMean??0)}function Rr(o,e,t,r){switch(o.kind){case"grab":{let n=v(e,o.uv),i=n&&z(e,n).add(new ee(...o.offset));return n&&i?{handles:[i],tethers:[[z(t,n),i]]}:{}}case"twist":{let n=v(t,o.uv);if(n===void 0)return{};let i=z(t,n),s=xt(i,new ee(...T(t,n)),o.radius*Lr*r);return{handles:[i],ring:s}}case"pinch":{let i=o.uvs.map(d=>v(t,d)).filter(d=>d!==void 0).map(d=>z(t,d)),[s,a]=i;return{handles:i,tethers:s&&a?[[s,a]]:[]}}case"anchor":return{handles:[new ee(...o.position)]}}}function z(o,e){return new ee(...M(o,e))}import{Vector3 as C}from"./vendor.js";var Cr=4,Or=Math.PI/200,Fe={step:1.1,least:.02,most:.5},Pt=new Map([["x",new C(1,0,0)],["y",new C(0,1,0)],["z",new C(0,0,1)]]),te=class{constructor(e,t){this.viewer=e;this.editor=t;let{signal:r}=this.listening,n={capture:!0,signal:r},{canvas:i}=e;i.addEventListener("pointerdown",s=>this.down(s),n),i.addEventListener("pointermove",s=>this.move(s),n),i.addEventListener("pointerup",s=>this.up(s),n),i.addEventListener("pointercancel",()=>this.cancel(),n),i.addEventListener("wheel",s=>this.wheel(s),{...n,passive:!1}),addEventListener("keydown",s=>this.key(s,!0),{signal:r}),addEventListener("keyup",s=>this.key(s,!1),{signal:r})}viewer;editor;hold;firstOfPinch;heldAxis;radius=.125;listening=new AbortController;get waitingPoint(){return this.editor.tool==="pinch"?this.firstOfPinch:void 0}cancel(){this.hold=void 0,this.firstOfPinch=void 0,this.editor.dropDraft()}dispose(){this.listening.abort()}down(e){let{tool:t,work:r}=this.editor;if(this.hold!==void 0){e.stopImmediatePropagation();return}if(t==="look"||r!==void 0||e.button!==0||!e.isPrimary)return;let n=this.viewer.pick(e.clientX,e.clientY),i=this.held(n?.cloth);n===void 0||i===void 0&&(t!=="anchor"||this.editor.editable.length===0)||(e.stopImmediatePropagation(),this.viewer.canvas.focus(),this.viewer.canvas.setPointerCapture(e.pointerId),this.hold={pointer:e.pointerId,x:e.clientX,y:e.clientY,hit:n,cloth:i,moved:!1})}move(e){let{hold:t}=this;if(t===void 0||e.pointerId!==t.pointer)return;e.stopImmediatePropagation(),t.moved||=Math.hypot(e.clientX-t.x,e.clientY-t.y)>Cr;let r=t.moved?this.dragged(t,e):void 0;r!==void 0&&this.editor.preview(r)}up(e){let{hold:t}=this;if(t===void 0||e.pointerId!==t.pointer)return;e.stopImmediatePropagation(),this.hold=void 0;let{tool:r}=this.editor;r==="pinch"?this.pinched(t):r==="anchor"&&!t.moved?(this.editor.preview(this.anchorAt(t,t.hit.position)),this.editor.commit()):t.moved&&this.editor.draft!==void 0&&this.editor.commit()}dragged(e,t){let{cloth:r}=e;switch(this.editor.tool){case"grab":return r&&this.grabbed(r,t);case"twist":return r&&this.twisted(r,t.clientX-e.x);case"anchor":{let n=this.viewer.onScreenPlane(t.clientX,t.clientY,e.hit.position);return n&&this.anchorAt(e,n)}default:return}}grabbed({point:e,position:t,normal:r},n){let{clientX:i,clientY:s}=n,a=n.shiftKey?r:Pt.get(this.heldAxis??""),d=a?this.viewer.onLine(i,s,t,a):this.viewer.onScreenPlane(i,s,t),{hole:l,uv:c}=e;return d&&{kind:"grab",hole:l,uv:c,offset:d.sub(t).toArray()}}twisted({point:e,normal:t},r){let n=t.clone();n.dot(this.viewer.camera.getWorldDirection(new C))>0&&n.negate();let{hole:i,uv:s}=e;return{kind:"twist",hole:i,uv:s,radius:this.radius,axis:n.toArray(),angle:-r*Or}}anchorAt({cloth:e},t){let r=t.toArray(),n=Xe(this.editor.editable,r)?.hole.id??0,{draft:i}=this.editor,s=i?.kind==="anchor"&&i.hard;return{kind:"anchor",hole:e?.point.hole??n,position:r,hard:s}}pinched({cloth:e}){let t=this.firstOfPinch;if(e===void 0)return;if(t===void 0||t.hole!==e.point.hole){this.firstOfPinch=e.point,this.editor.say("Pinch: click the second point.");return}this.firstOfPinch=void 0;let r=[t.uv,e.point.uv];this.editor.say("Pinch: choose how much, then apply."),this.editor.preview({kind:"pinch",hole:t.hole,uvs:r,amount:.5})}wheel(e){if(this.editor.tool!=="twist"||this.viewer.pick(e.clientX,e.clientY)?.cloth===void 0)return;e.preventDefault(),e.stopImmediatePropagation();let t=this.radius*Fe.step**-Math.sign(e.deltaY);this.radius=Math.min(Math.max(t,Fe.least),Fe.most);let{draft:r}=this.editor;r?.kind==="twist"?this.editor.preview({...r,radius:this.radius}):this.editor.say(`Twist: radius ${this.radius.toFixed(3)} of the chart.`)}key(e,t){let r=e.key.toLowerCase();t&&r==="escape"?this.cancel():Pt.has(r)&&(t?this.hold!==void 0:r===this.heldAxis)&&(this.heldAxis=t?r:void 0)}held(e){let t=this.editor.step.patches.find(({hole:r})=>r.id===e?.hole);return e&&t&&{point:e,position:new C(...M(t,e)),normal:new C(...T(t,e))}}};import{Box3 as sn,DirectionalLight as an,HemisphereLight as dn,OrbitControls as ln,PerspectiveCamera as cn,Plane as hn,Raycaster as pn,Scene as un,Sphere as je,Vector2 as fn,Vector3 as O,WebGLRenderer as mn}from"./vendor.js";function $t(o,e){let t=new Set(e),r=new Map;for(let n of o){let{centroid:i=[],length:s=0}=n,a;for(let d of t){let c=(Math.hypot(...d.centroid.map((h,f)=>h-(i[f]??0)))+Math.abs(d.length-s))/(s||1);c<(a?.cost??.05)&&(a={line:d,cost:c})}a!==void 0&&(t.delete(a.line),r.set(n.id??0,a.line))}return r}import{DoubleSide as _r,GLTFLoader as Jr,Mesh as Rt,MeshStandardMaterial as Mt,Triangle as Yr,Vector3 as Tt}from"./vendor.js";import{Box3 as Ur,BufferAttribute as Fr,DoubleSide as Nr,GLTFLoader as Ir,Mesh as Br,MeshBVH as jr,MeshStandardMaterial as Hr,MeshoptDecoder as Vr,Vector3 as Et,acceleratedRaycast as zr}from"./vendor.js";var re=class{worker;waiting=new Map;nextId=0;async boundary(e){let t=await this.ask({...e,job:"boundary"});return"lines"in t?t.lines:At(t)}async tree(e){let t=await this.ask({...e,job:"tree"});return"tree"in t?t.tree:At(t)}stop(){this.worker?.terminate(),this.worker=void 0;for(let[e,t]of this.waiting)t({id:e,error:"stopped"});this.waiting.clear()}ask(e){this.worker??=this.start();let t=this.nextId;this.nextId+=1;let r=new Promise(n=>this.waiting.set(t,n));return this.worker.postMessage({...e,id:t},[e.positions.buffer,e.triangles.buffer]),r}start(){let e=new Worker(Dr(),{type:"module"});return e.onmessage=({data:t})=>{this.waiting.get(t.id)?.(t),this.waiting.delete(t.id)},e.onerror=()=>this.stop(),e}};function Dr(){let o=new URL("./worker.js",import.meta.url);if(o.origin===location.origin)return o;let e=`import ${JSON.stringify(o.href)};`;return URL.createObjectURL(new Blob([e],{type:"text/javascript"}))}function At(o){throw new Error("error"in o?o.error:"the worker answered something else")}var Wr=12172998;function oe(o,e){return new Hr({color:o,roughness:.85,side:Nr,wireframe:e==="wireframe"})}var ne=class o{constructor(e){this.root=e;e.updateMatrixWorld(!0),this.bounds=new Ur().setFromObject(e),e.traverse(t=>{t instanceof Br&&(this.own.set(t,t.material),"isSkinnedMesh"in t||(t.raycast=zr))})}root;own=new Map;jobs=new re;bounds;plain;static async load(e){let t=await new Ir().setMeshoptDecoder(Vr).parseAsync(e,"");return new o(t.scene)}get meshes(){return[...this.own.keys()]}setShading(e){this.plain?.dispose();let t=e==="textured"?void 0:oe(Wr,e);this.plain=t;for(let[r,n]of this.own)r.material=t??n}materialNear(e){let t,r=new Et;for(let[n,i]of this.own){let s=n.geometry.getAttribute("position");for(let a=0;a<s.count;a+=1){let d=r.fromBufferAttribute(s,a).applyMatrix4(n.matrixWorld).distanceToSquared(e);d<(t?.distance??Number.POSITIVE_INFINITY)&&(t={distance:d,material:Array.isArray(i)?i[0]:i})}}return t?.material}boundaryLines(){return this.jobs.boundary(Gr(this.meshes.map(e=>St(e,e.matrixWorld))))}async buildTrees(){for(let e of this.meshes){let t=await this.jobs.tree(St(e,void 0));e.geometry.boundsTree=jr.deserialize(t,e.geometry)}}pick(e){return e.firstHitOnly=!0,e.intersectObjects(this.meshes,!1)[0]}dispose(){this.jobs.stop(),this.plain?.dispose();for(let[e,t]of this.own){e.geometry.dispose();for(let r of Array.isArray(t)?t:[t])Kr(r)}}};function St({geometry:o},e){let t=o.getAttribute("position"),r=new Float32Array(3*t.count),n=new Et;for(let s=0;s<t.count;s+=1)n.fromBufferAttribute(t,s),e!==void 0&&n.applyMatrix4(e),n.toArray(r,3*s);let i=o.index===null?qr(t.count):new Uint32Array(o.index.array);return{positions:r,triangles:i}}function qr(o){let e=new Uint32Array(o);for(let t=0;t<o;t+=1)e[t]=t;return e}function Gr(o){let e=s=>s.reduce((a,d)=>a+d.length,0),t=new Float32Array(e(o.map(s=>s.positions))),r=new Uint32Array(e(o.map(s=>s.triangles))),[n,i]=[0,0];for(let s of o){t.set(s.positions,n);let a=n/3;r.set(s.triangles.map(d=>d+a),i),n+=s.positions.length,i+=s.triangles.length}return{positions:t,triangles:r}}function Kr(o){for(let e of Object.values(o))typeof e=="object"&&e!==null&&"isTexture"in e&&e.dispose();o.dispose()}function Ne(o){return new Fr(o,3)}async function Ct(o){let{scene:e}=await new Jr().parseAsync(o,"");e.updateMatrixWorld(!0);let t=[];return e.traverse(r=>{r instanceof Rt&&t.push({geometry:r.geometry.applyMatrix4(r.matrixWorld),image:r.material.map})}),t}var ie=class{constructor(e,{geometry:t,image:r},n){this.patch=e;this.image=r;let i=e.hole.id??0,s=e.dressing.positions.get(i)??e.positions,a=t.getAttribute("position");this.rim=(e.hole.rimPositions?.length??0)/3,this.corners=Xr(a.array,s),this.firstNormals=new Float32Array(t.getAttribute("normal").array);let d=Lt(s,e.hole.patchFaces??[]);this.sides=Float32Array.from(this.corners,(l,c)=>[0,1,2].reduce((f,P)=>f+(d[3*l+P]??0)*(this.firstNormals[3*c+P]??0),0)<0?-1:1),t.setAttribute("position",Ne(new Float32Array(3*this.corners.length))),t.setAttribute("normal",Ne(new Float32Array(3*this.corners.length))),this.mesh=new Rt(t,n),this.mesh.name=`hole ${i}`,this.update(e)}patch;mesh;image;corners;rim;firstNormals;sides;get hole(){return this.patch.hole.id??0}get shown(){return this.patch}update(e){this.patch=e;let{geometry:t}=this.mesh,[r,n]=[t.getAttribute("position"),t.getAttribute("normal")],i=Lt(e.positions,e.hole.patchFaces??[]);for(let[s,a]of this.corners.entries()){let d=this.sides[s];for(let l=0;l<3;l+=1){let c=3*s+l;r.array[c]=e.positions[3*a+l],n.array[c]=a<this.rim?this.firstNormals[c]:d*i[3*a+l]}}r.needsUpdate=!0,n.needsUpdate=!0,t.computeBoundingSphere(),t.computeBoundingBox()}pointOf(e){if(e.face===null||e.face===void 0||!B(this.patch))return;let t=[e.face.a,e.face.b,e.face.c].map(l=>this.corners[l]),[r,n,i]=t.map(l=>this.vertex(l)),s=Yr.getBarycoord(e.point,r,n,i,new Tt)?.toArray();if(s===void 0)return;let a=this.patch.hole.patchUvs??[],d=[0,1].map(l=>t.reduce((c,h,f)=>c+s[f]*a[2*h+l],0));return v(this.patch,d)}dispose(){this.image?.dispose(),this.mesh.geometry.dispose()}vertex(e){return new Tt().fromArray(this.patch.positions,3*e)}};function Xr(o,e){let t=(n,i)=>n.subarray(3*i,3*i+3).join(),r=new Map;for(let n=0;n<e.length/3;n+=1)r.set(t(e,n),n);return Uint32Array.from({length:o.length/3},(n,i)=>r.get(t(o,i))??Qr(e,o.subarray(3*i,3*i+3)))}function Qr(o,e){let t={vertex:0,distance:Number.POSITIVE_INFINITY};for(let r=0;r<o.length/3;r+=1){let n=[0,1,2].reduce((i,s)=>i+(o[3*r+s]-e[s])**2,0);n<t.distance&&(t={vertex:r,distance:n})}return t.vertex}function Lt(o,e){let t=new Float32Array(o.length),r=(n,i)=>o[3*n+i];for(let n=0;n+2<e.length;n+=3){let[i,s,a]=[e[n],e[n+1],e[n+2]],[d,l,c]=[r(s,0)-r(i,0),r(s,1)-r(i,1),r(s,2)-r(i,2)],[h,f,P]=[r(a,0)-r(i,0),r(a,1)-r(i,1),r(a,2)-r(i,2)];for(let E of[i,s,a])t[3*E]=t[3*E]+l*P-c*f,t[3*E+1]=t[3*E+1]+c*h-d*P,t[3*E+2]=t[3*E+2]+d*f-l*h}for(let n=0;n<t.length;n+=3){let i=Math.hypot(...t.subarray(n,n+3))||1;for(let s=0;s<3;s+=1)t[n+s]=t[n+s]/i}return t}var Ot=15770462;function Dt(o,e){if(e!==null){let{roughness:t=.9,metalness:r=0}=o??{};return new Mt({map:e,roughness:t,metalness:r,side:_r})}return o?.clone()??new Mt({color:12172998})}import{Box3 as Zr,Group as en,Line2 as tn,LineGeometry as rn,LineMaterial as nn,Vector3 as Ie}from"./vendor.js";var Be={chosen:4,other:2},se=class{group=new en;lines=new Map;views=new Map;constructor(e,t,r){for(let n of e){let i=t.get(n.id??0);if(i===void 0)continue;let s=j(n.kind??""),a=r*(s.line==="dotted"?.003:.012),d=new nn({color:s.color,linewidth:Be.other,dashed:s.line!=="solid",dashSize:a,gapSize:s.line==="dotted"?2*a:.7*a}),l=new rn;l.setPositions([...i.points,...i.points.subarray(0,3)]);let c=new tn(l,d);c.computeLineDistances(),this.lines.set(n.id??0,c),this.views.set(n.id??0,on(i,n.kind)),this.group.add(c)}}choose(e){for(let[t,r]of this.lines)r.material.linewidth=e.has(t)?Be.chosen:Be.other}setVisible(e){this.group.visible=e}viewOf(e){return this.views.get(e)}dispose(){for(let e of this.lines.values())e.geometry.dispose(),e.material.dispose()}};function on({points:o},e){let t=Array.from({length:o.length/3},(s,a)=>new Ie().fromArray(o,3*a)),r=new Zr().setFromPoints(t),n=r.getCenter(new Ie),i=new Ie;return t.forEach((s,a)=>{let d=t[(a+1)%t.length];i.add(s.clone().sub(n).cross(d.clone().sub(n)))}),{bounds:r,front:e==="HOLE"?i.negate().normalize():i.normalize()}}var yn={shading:"textured",tinted:!0,outlined:!0,before:!1,split:0},ae=class{constructor(e){this.host=e;this.renderer=new mn({antialias:!0,alpha:!0}),this.renderer.setPixelRatio(Math.min(devicePixelRatio,2)),this.canvas.tabIndex=0,e.append(this.canvas),this.controls=new ln(this.camera,this.canvas),this.controls.enableDamping=!1,this.controls.addEventListener("change",()=>this.draw());let t=new an(16777215,1.9);t.position.set(1,1.2,.9),this.camera.add(t),this.scene.add(this.camera,new dn(16777215,9279397,1),this.marks.group),this.resized=new ResizeObserver(()=>this.resize()),this.resized.observe(e),this.canvas.addEventListener("webglcontextrestored",()=>this.draw()),this.resize()}host;camera=new cn(35,1,.01,100);controls;marks=new Z;renderer;scene=new un;raycaster=new pn;resized;scan;rims;patches=[];wanted=[];look=yn;sphere;frameAsked=0;get canvas(){return this.renderer.domElement}get rendererName(){let e=this.renderer.getContext(),t=e.getExtension("WEBGL_debug_renderer_info");return String(e.getParameter(t?.UNMASKED_RENDERER_WEBGL??e.RENDERER))}async showScan(e,t){let r=await ne.load(e.slice(0));this.clear(),this.scan=r,this.scene.add(r.root),r.setShading(this.look.shading);let n=r.bounds.getBoundingSphere(new je);this.lookAt(r.bounds,new O(.5,.5,1));let i=await r.boundaryLines();if(this.scan!==r)return;this.rims=new se(t,$t(t,i),n.radius||1),this.rims.setVisible(this.look.outlined),this.scene.add(this.rims.group);let s=G(t)[0]?.[1][0]?.id??0;this.lookAt(r.bounds,this.rims.viewOf(s)?.front??new O(.5,.5,1)),r.buildTrees().catch(()=>{})}chooseLoops(e){this.rims?.choose(e),this.draw()}async showPatches(e){this.wanted=e;let t=e[0]?.dressing;if(!this.showsSurfacesOf(e)){let r=t===void 0?[]:await Ct(t.glb.slice(0));if(this.wanted[0]?.dressing!==t)return;this.showsSurfacesOf(this.wanted)||this.replacePatches(r)}this.wanted.forEach((r,n)=>{this.patches[n]?.shown!==r&&this.patches[n]?.update(r)}),this.draw()}setLook(e){let t=this.look;if(this.look={...t,...e},this.rims?.setVisible(this.look.outlined),t.shading!==this.look.shading&&this.scan?.setShading(this.look.shading),t.shading!==this.look.shading||t.tinted!==this.look.tinted)for(let r of this.patches)r.mesh.material.dispose(),r.mesh.material=this.materialOf(r.shown,r.image);this.draw()}frame(e){let t=e===void 0?void 0:this.rims?.viewOf(e);this.lookAt(t?.bounds??this.scan?.bounds??new sn,t?.front??new O)}pivotAt(e){this.controls.target.copy(e),this.controls.update(),this.draw()}pick(e,t){this.aim(e,t);let r=this.look.before?[]:this.patches,n=this.raycaster.intersectObjects(r.map(({mesh:s})=>s),!1)[0],i=this.scan?.pick(this.raycaster);if(n!==void 0&&n.distance<=(i?.distance??Number.POSITIVE_INFINITY)){let s=this.patches.find(({mesh:a})=>a===n.object);return{position:n.point,cloth:s?.pointOf(n)}}return i&&{position:i.point,cloth:void 0}}onScreenPlane(e,t,r){this.aim(e,t);let n=new hn().setFromNormalAndCoplanarPoint(this.camera.getWorldDirection(new O),r);return this.raycaster.ray.intersectPlane(n,new O)??void 0}onLine(e,t,r,n){this.aim(e,t);let{origin:i,direction:s}=this.raycaster.ray,a=r.clone().sub(i),d=n.dot(s),l=(d*s.dot(a)-n.dot(a))/Math.max(1-d*d,1e-6);return r.clone().addScaledVector(n,l)}draw(){this.frameAsked===0&&(this.frameAsked=requestAnimationFrame(()=>{this.frameAsked=0,this.drawNow()}))}dispose(){cancelAnimationFrame(this.frameAsked),this.clear(),this.resized.disconnect(),this.controls.dispose(),this.renderer.dispose(),this.canvas.remove()}drawNow(){this.fitDepth(),this.marks.fit(this.camera,this.host.clientHeight);let{clientWidth:e,clientHeight:t}=this.host,r=Math.round(this.look.split*e);this.renderer.setScissorTest(r>0),this.drawPart(r>0?[r,e-r]:[0,e],t,!this.look.before),r>0&&this.drawPart([0,r],t,!1)}drawPart([e,t],r,n){this.look.split>0&&this.renderer.setScissor(e,0,t,r),this.patches.forEach(({mesh:i})=>i.visible=n),this.renderer.render(this.scene,this.camera),this.patches.forEach(({mesh:i})=>i.visible=!0)}lookAt(e,t){let{center:r,radius:n}=e.getBoundingSphere(new je);if(e.isEmpty()||!(n>0))return;let i=Math.min(1,this.camera.aspect),s=1.1*n/Math.sin(this.camera.fov*Math.PI/360)/i,a=t.lengthSq()>0?t.clone():this.camera.position.clone().sub(this.controls.target);this.controls.target.copy(r),this.camera.position.copy(r).addScaledVector(a.normalize(),s),this.fitDepth(),this.controls.update(),this.draw()}aim(e,t){let{left:r,top:n,width:i,height:s}=this.canvas.getBoundingClientRect(),a=new fn((e-r)/i*2-1,1-(t-n)/s*2);this.camera.updateMatrixWorld(),this.raycaster.setFromCamera(a,this.camera)}materialOf({hole:e},t){let{shading:r,tinted:n}=this.look;if(n)return oe(Ot,r);if(r!=="textured")return oe(12172998,r);let i=this.scan?.materialNear(new O().fromArray(e.rimPositions??[0,0,0]));return Dt(i,t)}fitDepth(){if(this.scan!==void 0){this.sphere??=this.scan.bounds.getBoundingSphere(new je);let{center:e,radius:t}=this.sphere,r=this.camera.position.distanceTo(e);this.camera.far=r+4*t,this.camera.near=Math.max(r-4*t,this.camera.far/5e3),this.camera.updateProjectionMatrix()}}resize(){let{clientWidth:e,clientHeight:t}=this.host;e>0&&t>0&&(this.renderer.setSize(e,t),this.camera.aspect=e/t,this.camera.updateProjectionMatrix(),this.drawNow())}clear(){this.clearPatches(),this.marks.clear(),this.scan!==void 0&&(this.scene.remove(this.scan.root),this.scan.dispose()),this.rims!==void 0&&(this.scene.remove(this.rims.group),this.rims.dispose()),this.scan=void 0,this.rims=void 0,this.sphere=void 0}showsSurfacesOf(e){let t=(r,n)=>this.patches[n]?.shown.dressing===r.dressing;return e.length===this.patches.length&&e.every(t)}replacePatches(e){this.clearPatches(),this.wanted.forEach((t,r)=>{let n=e[r];if(n!==void 0){let i=new ie(t,n,this.materialOf(t,n.image));this.patches.push(i),this.scene.add(i.mesh)}})}clearPatches(){for(let e of this.patches)this.scene.remove(e.mesh),e.mesh.material.dispose(),e.dispose();this.patches=[]}};import{css as gn,html as bn}from"./vendor.js";var He=class extends p{static styles=[p.styles,gn`
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
    `].flat();viewer;gestures;opened=()=>{this.show()};connectedCallback(){super.connectedCallback(),this.editor.addEventListener("opened",this.opened)}disconnectedCallback(){super.disconnectedCallback(),this.editor.removeEventListener("opened",this.opened),this.gestures?.dispose(),this.viewer?.dispose(),this.viewer=void 0}render(){return bn`<div id="host"></div>`}firstUpdated(){let e=this.renderRoot.querySelector("#host");if(e===null)return;try{this.viewer=new ae(e),this.gestures=new te(this.viewer,this.editor)}catch(r){this.editor.report(new Error(`This browser draws no 3-D pictures (WebGL 2): ${String(r)}`));return}let{canvas:t}=this.viewer;t.setAttribute("role","img"),t.setAttribute("aria-label","The scan. Drag to turn it, two fingers or the right button to move it, F to see all."),t.addEventListener("dblclick",r=>{let n=this.viewer?.pick(r.clientX,r.clientY);n!==void 0&&this.viewer?.pivotAt(n.position)})}updated(){this.viewer?.chooseLoops(this.editor.chosen),this.viewer?.showPatches(this.editor.patches),this.viewer?.marks.show(kt(this.editor,this.gestures?.waitingPoint))}async show(){let{scan:e}=this.editor;if(e!==void 0)try{await this.viewer?.showScan(e.bytes,e.loops),this.requestUpdate()}catch(t){this.editor.report(new Error(`The scan was read by the service, but cannot be drawn: ${String(t)}`))}}};customElements.define("darn-stage",He);import{css as vn,html as g,nothing as de}from"./vendor.js";var le=[{tool:"look",name:"Look",key:"L",help:"Drag to turn the scan, right button or two fingers to move it, wheel to zoom."},{tool:"grab",name:x.grab,key:"G",help:"Drag new cloth in the plane of the screen; hold Shift to pull it along its normal, or X, Y or Z along an axis."},{tool:"twist",name:x.twist,key:"T",help:"Drag to the left or right on new cloth to turn a disk of it; the wheel changes its size."},{tool:"pinch",name:x.pinch,key:"P",help:"Click two points of new cloth, then choose how far to draw them together."},{tool:"anchor",name:x.anchor,key:"A",help:"Drag from the cloth to where it should be, or type the point; the service finds which place of the cloth belongs there."}],wn=["x","y","z"],Ve=class extends p{static styles=[p.styles,vn`
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
    `].flat();render(){let{tool:e,step:t,editable:r}=this.editor,n=le.find(i=>i.tool===e)?.help??"";return g`
      <h2>Tools</h2>
      <div class="row tools" role="group" aria-label="Tools">
        ${le.map(i=>g`
            <button
              aria-pressed=${i.tool===e}
              aria-keyshortcuts=${i.key}
              title="${i.name} (${i.key})"
              ?disabled=${r.length===0&&i.tool!=="look"}
              @click=${()=>this.editor.setTool(i.tool)}
            >
              ${i.name}
            </button>
          `)}
      </div>
      <p class="quiet small">${r.length>0?n:xn(t.patches.length)}</p>
      ${e==="look"||r.length===0?de:this.form(this.draftOf(e))}
    `}draftOf(e){let{draft:t,editable:r}=this.editor,[n]=r;return t?.kind===e?t:n&&xe(e,n)}form(e){if(e===void 0)return de;let{work:t}=this.editor,r=t!==void 0;return g`
      <form @submit=${n=>this.apply(n,e)}>
        ${this.holeField(e)} ${this.fields(e)}
        <div class="row wide">
          <button class="main" ?disabled=${r}>${e.kind==="anchor"?"Find its place":"Apply"}</button>
          <button type="button" ?disabled=${this.editor.draft===void 0} @click=${()=>this.editor.dropDraft()}>
            Cancel
          </button>
          ${e.kind==="anchor"?g`<button type="button" ?disabled=${r} @click=${()=>this.editor.findAnchor(e,!0)}>
                  Draw the map
                </button>`:de}
        </div>
      </form>
    `}holeField(e){let t=this.editor.editable;return t.length<2?de:g`
      <label class="wide">
        Hole
        <select @change=${n=>{let i=Number(n.target.value),s=t.find(({hole:a})=>a.id===i);s!==void 0&&this.preview(e.kind==="anchor"?{...e,hole:i}:xe(e.kind,s))}}>
          ${t.map(({hole:n})=>g`<option value=${n.id} ?selected=${n.id===e.hole}>${n.id}</option>`)}
        </select>
      </label>
    `}fields(e){switch(e.kind){case"grab":return this.grabFields(e);case"twist":return this.twistFields(e);case"pinch":return this.pinchFields(e);case"anchor":return this.anchorFields(e)}}grabFields(e){return g`
      ${this.uvFields(e.uv,"",t=>({...e,uv:t}))}
      <span></span>
      ${this.vectorFields("Move",e.offset,t=>({...e,offset:t}))}
    `}twistFields(e){let t=e.angle*180/Math.PI;return g`
      ${this.uvFields(e.uv,"",r=>({...e,uv:r}))}
      ${this.number("Radius",e.radius,r=>({...e,radius:r}))}
      ${this.vectorFields("Axis",e.axis,r=>({...e,axis:r}))}
      ${this.number("Angle in degrees",t,r=>({...e,angle:r*Math.PI/180}))}
    `}pinchFields(e){let[t,r]=e.uvs,n=i=>{this.preview({...e,amount:Number(i.target.value)})};return g`
      ${this.uvFields(t,"First ",i=>({...e,uvs:[i,r]}))}
      <span></span>
      ${this.uvFields(r,"Second ",i=>({...e,uvs:[t,i]}))}
      <span></span>
      <label class="wide">
        Share of their distance to take away: ${Math.round(e.amount*100)} %
        <input type="range" min="0" max="1" step="0.01" .value=${String(e.amount)} @input=${n} />
      </label>
    `}anchorFields(e){let t=r=>{this.preview({...e,hard:r.target.checked})};return g`
      ${this.vectorFields("Point",e.position,r=>({...e,position:r}))}
      <label class="wide check">
        <input type="checkbox" .checked=${e.hard} @change=${t} />
        Hard: refuse it where the cloth cannot reach it
      </label>
    `}uvFields([e,t],r,n){return[this.number(`${r}u`,e,i=>n([i,t])),this.number(`${r}v`,t,i=>n([e,i]))]}vectorFields(e,t,r){return wn.map((n,i)=>this.number(`${e} ${n}`,t[i],s=>r(t.with(i,s))))}number(e,t,r){let n=i=>{let s=i.target.valueAsNumber;Number.isFinite(s)&&this.preview(r(s))};return g`
      <label>
        ${e}
        <input type="number" step="any" .value=${String(Number(t.toPrecision(6)))} @change=${n} />
      </label>
    `}preview(e){this.editor.preview(e)}apply(e,t){e.preventDefault(),this.editor.preview(t),this.editor.commit()}};customElements.define("darn-tools",Ve);function xn(o){return o===0?"Mend a hole to edit its new cloth.":"The cloth around what is filled cannot be laid flat, so its new cloth takes no gestures."}var ze=class extends kn{static styles=[L,Pn`
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
    `];static properties={src:{},key:{},baseUrl:{attribute:"base-url"}};dragging=!1;made;constructor(){super(),this.addEventListener("dragover",this.dragOver),this.addEventListener("dragleave",this.dragLeave),this.addEventListener("drop",this.drop)}get editor(){return this.made??=this.makeEditor(),this.made}makeEditor(){let e=new Q(this.base),t=async()=>{await this.updateComplete;let i=await this.keyDialog?.ask();return e.keep(i),i},r=new I(this.base,{key:this.key??e.kept,askForKey:t}),n=new _(r);n.addEventListener("change",()=>this.requestUpdate()),n.addEventListener("opened",()=>this.emit("opened",{name:n.scan?.name}));for(let i of["mended","edited"])n.addEventListener(i,()=>{let{report:s,constraints:a}=n.step;this.emit(i,{report:s,constraints:a})});return n}get base(){return new URL(this.baseUrl??new URL("..",import.meta.url),document.baseURI)}connectedCallback(){super.connectedCallback(),addEventListener("keydown",this.keyDown),addEventListener("keyup",this.keyUp)}disconnectedCallback(){super.disconnectedCallback(),removeEventListener("keydown",this.keyDown),removeEventListener("keyup",this.keyUp)}willUpdate(e){let{src:t}=this;if(!(!e.has("src")||t===void 0))try{this.editor.openAddress(new URL(t,document.baseURI))}catch{this.editor.report(new Error(`${t} is not an address.`))}}emit(e,t){return this.dispatchEvent(new CustomEvent(e,{detail:t,bubbles:!0,composed:!0,cancelable:!0}))}render(){let{editor:e}=this,{scan:t,work:r}=e;return D`
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
        <input
          id="file"
          type="file"
          accept=".glb,.gltf,.bin,.png,.jpg,.jpeg,.webp"
          multiple
          hidden
          @change=${this.picked}
        />
      </header>
      <main class=${this.dragging?"over":""}>
        <darn-stage .editor=${e}></darn-stage>
        ${t===void 0&&r===void 0?this.welcome():Ut} ${this.notices()}
      </main>
      <aside @darn-frame=${this.frame} @darn-look=${this.look}>
        ${t===void 0?D`<p class="quiet">The holes of the scan will be listed here.</p>`:D`
                <darn-holes .editor=${e}></darn-holes>
                <darn-tools .editor=${e}></darn-tools>
                <darn-chart .editor=${e}></darn-chart>
                <darn-look .editor=${e}></darn-look>
                <darn-report .editor=${e}></darn-report>
                <darn-constraints .editor=${e}></darn-constraints>
              `}
      </aside>
      <darn-key></darn-key>
      <div class="hidden" role="status" aria-live="polite">${e.work?.label??e.message}</div>
    `}welcome(){return D`
      <div class="welcome">
        <h2>Mend a scan of cloth</h2>
        <p>
          Drop a glTF file here: a GLB, or a glTF together with the files that it refers to. The service finds its holes
          and fills them with cloth that continues the folds around them. The scan itself stays as it is.
        </p>
        <div class="row">
          <button class="main" @click=${this.pick}>Open a scan</button>
          <button id="example" @click=${this.openExample}>Try the example</button>
        </div>
      </div>
    `}notices(){let{work:e,problem:t}=this.editor;return t!==void 0?D`
        <div class="notice problem" role="alert">
          <p>${t}</p>
          <button @click=${()=>this.editor.clearProblem()}>Close</button>
        </div>
      `:e===void 0?Ut:D`
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
    `}get keyDialog(){return this.renderRoot.querySelector("darn-key")}get stage(){return this.renderRoot.querySelector("darn-stage")}pick=()=>this.renderRoot.querySelector("#file")?.click();picked=e=>{let t=e.target;this.openFiles([...t.files??[]]),t.value=""};async openFiles(e){try{let t=await lt(e);t!==void 0&&await this.editor.open(t.file,t.name)}catch(t){this.editor.report(t)}}openExample=()=>{this.editor.openAddress(new URL("editor/scarf_hole.glb",this.base))};save=async()=>{let e=await this.editor.result();if(e!==void 0){let r=(this.editor.scan?.name??"scan.glb").replace(/(\.[a-z]+)?$/i,n=>`.mended${n||".glb"}`);this.emit("saved",{file:e,name:r})&&J(e,r)}};dragOver=e=>{e.preventDefault(),this.setDragging(!0)};dragLeave=()=>this.setDragging(!1);drop=e=>{e.preventDefault(),this.setDragging(!1),this.openFiles([...e.dataTransfer?.files??[]])};setDragging(e){this.dragging=e,this.requestUpdate()}frame=e=>this.stage?.viewer?.frame(e.detail);look=e=>this.stage?.viewer?.setLook(e.detail);keyDown=e=>{if(!this.isMeant(e))return;let t=e.key.toLowerCase();if((e.ctrlKey||e.metaKey)&&(t==="z"||t==="y")&&!Ft(e)){e.preventDefault(),t==="y"||e.shiftKey?this.editor.redo():this.editor.undo();return}if(e.ctrlKey||e.metaKey||e.altKey||Ft(e))return;let r=le.find(n=>n.key.toLowerCase()===t)?.tool;r!==void 0&&(r==="look"||this.editor.editable.length>0)?this.editor.setTool(r):t==="f"?this.stage?.viewer?.frame():t==="b"&&this.stage?.viewer?.setLook({before:!0})};isMeant(e){let t=e.composedPath();return t.includes(this)||t[0]===document.body}keyUp=e=>{e.key.toLowerCase()==="b"&&this.stage?.viewer?.setLook({before:!1})}};function Ft(o){let e=o.composedPath()[0];return e instanceof HTMLTextAreaElement||e instanceof HTMLInputElement&&!["checkbox","radio","range","button"].includes(e.type)}customElements.define("darn-editor",ze);
