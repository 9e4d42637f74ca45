function te({hole:o}){return(o.patchUvs?.length??0)>0}function M(o,e){if(!te(o))return;let{patchFaces:t=[],patchUvs:r=[],id:n=0}=o.hole,i=s=>[r[2*s],r[2*s+1]];for(let s=0;s+2<t.length;s+=3){let a=t.slice(s,s+3),d=Yn(e,a.map(i));if(d!==void 0)return{hole:n,uv:e,vertices:a,weights:d}}}function _({positions:o},{vertices:e,weights:t}){return[0,1,2].map(r=>e.reduce((n,i,s)=>n+t[s]*o[3*i+r],0))}function W({positions:o},{vertices:e}){let[t,r,n]=e.map(c=>[...o.subarray(3*c,3*c+3)]),[i,s]=[st(r,t),st(n,t)],a=[i[1]*s[2]-i[2]*s[1],i[2]*s[0]-i[0]*s[2],i[0]*s[1]-i[1]*s[0]],d=Math.hypot(...a)||1;return a.map(c=>c/d)}function me(o){let{rimUvs:e=[]}=o.hole,t=e.length/2||1,r=[0,1].map(s=>e.reduce((a,d,c)=>c%2===s?a+d:a,0)/t),n=o.hole.patchUvs??[],i={uv:r,distance:Number.POSITIVE_INFINITY};for(let s=0;s+1<n.length;s+=2){let a=[n[s],n[s+1]],d=Math.hypot(a[0]-r[0],a[1]-r[1]);d<i.distance&&(i={uv:a,distance:d})}return i.uv}function dr(o,e){let t;for(let r of o){let n=r.hole.rimPositions??[];for(let i=0;i+2<n.length;i+=3){let s=Math.hypot(...st(n.slice(i,i+3),e));s<(t?.distance??Number.POSITIVE_INFINITY)&&(t={patch:r,distance:s})}}return t?.patch}function st(o,e){return[o[0]-e[0],o[1]-e[1],o[2]-e[2]]}function Yn([o,e],[t,r,n]){let i=(r[0]-t[0])*(n[1]-t[1])-(n[0]-t[0])*(r[1]-t[1]);if(i===0)return;let s=((o-t[0])*(n[1]-t[1])-(n[0]-t[0])*(e-t[1]))/i,a=((r[0]-t[0])*(e-t[1])-(o-t[0])*(r[1]-t[1]))/i,d=1-s-a,c=-1e-6;return d>=c&&s>=c&&a>=c?[d,s,a]:void 0}var cr=new Map([["HOLE",{plural:"Holes",singular:"Hole",color:"#d9480f",line:"solid"}],["OPENING",{plural:"Openings",singular:"Opening",color:"#9c5fd0",line:"dotted"}],["TUBE_END",{plural:"Ends of sleeves",singular:"End of a sleeve",color:"#37a04d",line:"dotted"}],["OUTER_BOUNDARY",{plural:"Borders",singular:"Border",color:"#3f86c9",line:"dashed"}]]);function re(o){let e=o.toLowerCase().replaceAll("_"," "),t=e.charAt(0).toUpperCase()+e.slice(1);return cr.get(o)??{plural:t,singular:t,color:"#862e9c",line:"dotted"}}function P(o){return o.kind==="HOLE"}function lr(o){return o.kind!=="OUTER_BOUNDARY"}function G(o){let e=[...cr.keys()],t=new Map(e.map(n=>[n,[]]));for(let n of o){let i=n.kind??"LOOP_KIND_UNSPECIFIED";t.set(i,[...t.get(i)??[],n])}let r=n=>n.length??0;return[...t].filter(([,n])=>n.length>0).map(([n,i])=>[n,i.sort((s,a)=>r(a)-r(s))])}function b(o){return o===void 0||!Number.isFinite(o)?"\u2013":o!==0&&(Math.abs(o)>=1e6||Math.abs(o)<.001)?o.toExponential(2):String(Number(o.toPrecision(3)))}function E(o){return o.kind==="cut"||o.kind==="polygon"||o.kind==="border"}function ur(o){return o.kind!=="polygon"||o.corners.length>=3}var $={grab:"Grab",twist:"Twist",pinch:"Pinch",anchor:"Anchor",cut:"Cut out",polygon:"Cut out",border:"Border"};function at(o,e){let t=e.hole.id??0,r=me(e),n=M(e,r);switch(o){case"grab":return{kind:o,hole:t,uv:r,offset:[0,0,0]};case"twist":return{kind:o,hole:t,uv:r,radius:.125,axis:n?W(e,n):[0,1,0],angle:0};case"pinch":return{kind:o,hole:t,uvs:[r,[r[0]+.1,r[1]]],amount:.5};case"anchor":return{kind:o,hole:t,position:n?_(e,n):[0,0,0],hard:!1}}}function dt({border:o}){let e=({from:r,to:n})=>({from:ye(r),to:ye(n)}),t=o?.facing;return{kind:"border",...e(o??{}),along:[],...t&&{facing:e(t)}}}function be(o,{loops:e,candidates:t}){let r=hr(e),n=ye(r?.centroid);switch(o){case"cut":{let i=(r?.diameter??1)*(r?.kind==="HOLE"?.55:.05);return{kind:o,center:n,radius:i}}case"polygon":return{kind:o,corners:[]};case"border":{let[i]=t;return i?dt(i):{kind:o,from:n,to:n,along:[]}}}}function hr(o){return G(o)[0]?.[1][0]}function pr(o,e){let{corners:t}=o;return{...o,corners:[...t,t.at(-1)??ye(hr(e)?.centroid)]}}function ge(o,e,t){return{...o,corners:o.corners.map((r,n)=>n===e?t:r)}}function ve(o){return{...o,corners:o.corners.slice(0,-1)}}function ct({corners:o,depth:e}){let t=r=>Math.max(...o.map(n=>ne(r,n)));return e??Math.max(0,...o.map(t))/10}function ye([o=0,e=0,t=0]=[]){return[o,e,t]}function N({from:o,to:e,along:t,facing:r}){return r?[o,e,r.from,r.to]:[o,e,...t]}function fr({facing:o}){return o?4:2}function we(o,e,t){let r=N(o).with(e,t);if(o.facing===void 0){let[d,c,...l]=r;return{...o,from:d,to:c,along:l}}let[n,i,s,a]=r;return{...o,from:n,to:i,facing:{from:s,to:a}}}function mr({from:o,to:e}){return{kind:"border",from:o,to:e,along:[],facing:{from:o,to:e}}}function yr({from:o,to:e}){return{kind:"border",from:o,to:e,along:[]}}function br({from:o,to:e,along:t,facing:r}){if(r===void 0)return[[o,...t,e]];let n=ne(o,r.from)+ne(e,r.to),i=ne(o,r.to)+ne(e,r.from),[s,a]=n<=i?[r.from,r.to]:[r.to,r.from];return[[o,s],[e,a]]}function ne(o,e){return Math.hypot(o[0]-e[0],o[1]-e[1],o[2]-e[2])}function gr(o){switch(o.kind){case"cut":return{cut:{center:[...o.center],radius:o.radius}};case"polygon":return{cut:{polygon:o.corners.map(e=>[...e]),depth:ct(o)}};case"border":{let e=o.along.map(n=>[...n]),t=o.facing&&{from:[...o.facing.from],to:[...o.facing.to]};return{border:{...{from:[...o.from],to:[...o.to]},...e.length>0&&{along:e},...t&&{facing:t}}}}}}function lt(o,e){return{...o,edits:[...o.edits,Xn(e)]}}function xe(o,{hole:e,position:t,hard:r,replaces:n},i){let s={hole:e,uv:[...i],position:[...t],...r&&{hard:r}},{anchors:a}=o,d=n===void 0||n>=a.length;return{...o,anchors:d?[...a,s]:a.with(n,s)}}function ut(o,e){if(!E(e))return e.kind==="anchor"?e.uv&&xe(o,e,e.uv):lt(o,e)}function Xn(o){let{hole:e}=o;switch(o.kind){case"grab":return{hole:e,grab:{uv:[...o.uv],offset:[...o.offset]}};case"twist":return{hole:e,twist:{uv:[...o.uv],radius:o.radius,axis:[...o.axis],angle:o.angle}};case"pinch":return{hole:e,pinch:{uvs:o.uvs.map(t=>[...t]),amount:o.amount}}}}var H=class{running;waiting;offer(e){if(this.running!==void 0){this.waiting=e;return}this.running=this.run(e)}async settled(){this.waiting=void 0,await this.running}async run(e){for(let t=e;t!==void 0;)await t(),t=this.waiting,this.waiting=void 0;this.running=void 0}};var w=class extends Error{constructor(t,r,n,i,s=[]){super(n);this.status=t;this.code=r;this.retryAfter=i;this.fields=s}status;code;retryAfter;fields;name="ProblemError";get keyIsRefused(){return this.status===401}get sessionIsGone(){return this.status===410||this.code==="session_not_found"}};function Pe(o,e,t){let r=Number(e??Number.NaN),n=Number.isFinite(r)&&r>=0?r:void 0;try{let{code:i,detail:s,errors:a=[]}=JSON.parse(t);return new w(o,i??"",s??vr(o),n,a)}catch{return new w(o,"",vr(o),n)}}function ht(o){return o instanceof w?Qn(o):o instanceof TypeError&&/fetch|network/i.test(o.message)?"The service cannot be reached.":ke(o instanceof Error?o.message:String(o))}function oe(o){return o instanceof DOMException&&o.name==="AbortError"}function vr(o){return`The service answered with status ${o}.`}function Qn({code:o,message:e,fields:t}){if(o==="anchor_out_of_reach"&&t.length>0)return[...t.map(({pointer:s="",detail:a=""})=>ke(`${wr(s)}: ${a}`)),"Move the point nearer to the cloth, or make the anchor soft."].join(`
`);let n=t.filter(({detail:i=""})=>!e.includes(i)).map(({pointer:i="",detail:s=""})=>ke(`${wr(i)}: ${s}`));return[ke(e),...n].join(`
`)}function wr(o){let[,e="",t=""]=o.split("/"),r=new Map([["anchors","Anchor"],["edits","Gesture"]]).get(e);return r!==void 0&&/^\d+$/.test(t)?`${r} ${Number(t)+1}`:o||"The request"}function ke(o){let e=o.charAt(0).toUpperCase()+o.slice(1);return/[.!?]$/.test(e)?e:`${e}.`}var ie=class o{constructor(e,t,r,n){this.service=e;this.scan=t;this.selection=r;this.opened=n}service;scan;selection;opened;live=new H;met;static async open(e,t,r={},n={}){return new o(e,t,r,await e.openSession(t,r,n))}get holes(){return this.opened.holes??[]}get skipped(){return this.opened.skipped??[]}get cutFaces(){return this.opened.cutFaces??[]}drag(e,{onPatches:t,onError:r}){this.live.offer(async()=>{try{t(await this.draft(e))}catch(n){r(n)}})}async release(e,t={}){return await this.live.settled(),this.mend(e,t)}draft(e,t={}){return this.within(t,async r=>{let n=await this.service.draft(r,e,t),i=n.length/2,s=this.byHole(n.subarray(i));return this.byHole(n.subarray(0,i)).map((a,d)=>({...a,normals:s[d].positions}))})}positions(e,t={}){return this.within(t,async r=>{let n=await this.meeting(e,()=>this.service.positions(r,e,t));return this.byHole(n)})}mend(e,t={}){return this.within(t,async r=>{let{positions:n,report:i}=await this.meeting(e,()=>this.service.mend(r,e,t));return{patches:this.byHole(n),report:i}})}patches(e,t={}){return this.within(t,r=>this.meeting(e,()=>this.service.patches(r,e,t)))}optimizeAnchor(e,t={}){return this.within(t,r=>this.service.optimizeAnchor(r,e,t))}anchorMap(e,t,r={}){return this.within(r,n=>this.service.anchorMap(n,e,t,r))}result(e,t={}){return this.within(t,async r=>(await this.meet(r,e,t),this.service.result(r,t)))}close(){this.service.close(this.id)}get id(){return this.opened.id??""}async meet(e,t,r){this.met!==JSON.stringify(t)&&await this.meeting(t,()=>this.service.mend(e,t,r))}async meeting(e,t){this.met=void 0;let r=await t();return this.met=JSON.stringify(e),r}async within(e,t){try{return await t(this.id)}catch(r){if(!(r instanceof w&&r.sessionIsGone))throw r;return this.met=void 0,this.opened=await this.service.openSession(this.scan,this.selection,e),t(this.id)}}byHole(e){let t=0;return this.holes.map(r=>{let n=t+3*Zn(r),i=e.subarray(t,n);return t=n,{hole:r,positions:i}})}};function Zn({patchUvs:o=[],patchFaces:e=[]}){return o.length>0?o.length/2:e.reduce((t,r)=>Math.max(t,r+1),0)}async function*xr(o,e){let t=o.getReader(),r=new TextDecoder,[n,i,s]=["","",[]];try{for(;;){let{done:a,value:d}=await eo(t.read(),e);if(a)return;n+=r.decode(d,{stream:!0});let c=n.split(/\r\n|\n|\r(?!$)/);n=c.pop()??"";for(let l of c){if(l===""){s.length>0&&(yield{id:i,data:s.join(`
`)}),s=[];continue}let[,h,p]=/^([^:]*)(?:: ?(.*))?$/.exec(l)??[];h==="data"?s.push(p??""):h==="id"&&(i=p??"")}}}finally{t.cancel().catch(()=>{})}}function eo(o,e){return new Promise((t,r)=>{let n=setTimeout(()=>r(new Error("The service says nothing any more.")),e);o.then(t,r).finally(()=>clearTimeout(n))})}var to=5,ro=60;function kr(o,e={}){return typeof XMLHttpRequest>"u"?pt(o.url,{method:"POST",headers:o.headers,body:o.body},e):Ae(e,()=>no(o,e))}function pt(o,e,t={}){return Ae(t,async()=>{let r=await ft(o,{...e,signal:t.signal??null});return{contentType:r.headers.get("content-type")??"",body:await r.arrayBuffer()}})}async function ft(o,e){let t=await fetch(o,e);if(!t.ok)throw Pe(t.status,t.headers.get("retry-after"),await t.text());return t}async function Pr(o,e){let t=o.body?.getReader(),r=new TextDecoder,n="";for(;;){let{done:i,value:s}=await t?.read()??{done:!0,value:void 0};n+=r.decode(s,{stream:!i});let a=n.split(`
`);n=i?"":a.pop()??"";for(let d of a.filter(c=>c!==""))e(JSON.parse(d));if(i)return}}function A(o){return JSON.parse(new TextDecoder().decode(o.body))}async function Ae(o,e){for(let t=1;;t+=1)try{return await e()}catch(r){let n=r instanceof w&&r.status===503?r.retryAfter:void 0;if(n===void 0||n>ro||t===to)throw r;o.onWait?.(n),await mt(n,o.signal)}}function mt(o,e){return new Promise((t,r)=>{let n=()=>{clearTimeout(i),r(new DOMException("stopped","AbortError"))},i=setTimeout(()=>{e?.removeEventListener("abort",n),t()},o*1e3);e?.aborted&&n(),e?.addEventListener("abort",n,{once:!0})})}function no({url:o,headers:e,body:t},{onSent:r,signal:n}){return new Promise((i,s)=>{let a=new XMLHttpRequest;a.open("POST",o);for(let[d,c]of Object.entries(e))a.setRequestHeader(d,c);a.responseType="arraybuffer",a.upload.onprogress=d=>{d.lengthComputable&&d.total>0&&r?.(d.loaded/d.total)},a.onload=()=>{let d=a.response;if(a.status<400)i({contentType:a.getResponseHeader("content-type")??"",body:d});else{let c=new TextDecoder().decode(d);s(Pe(a.status,a.getResponseHeader("retry-after"),c))}},a.onerror=()=>s(new Error("The service cannot be reached, or it closed the connection.")),a.onabort=()=>s(new DOMException("stopped","AbortError")),n?.addEventListener("abort",()=>a.abort()),a.send(t)})}var oo=45e3,yt={first:.5,longest:30},se=class{constructor(e){this.transport=e}transport;async submit(e,t,r={},n={}){let i=new FormData;i.append("scan",e,"scan"),i.append("constraints",new Blob([JSON.stringify(t)],{type:"application/json"}),"constraints");let{name:s,priority:a,webhook:d,idempotencyKey:c=crypto.randomUUID()}=r,l=`jobs${Ar({name:s,priority:a,webhook:d})}`;return A(await this.transport.upload(l,i,n,{"idempotency-key":c}))}async get(e,t={}){return A(await this.transport.send(I(e),{},t))}async list({state:e,from:t,limit:r}={},n={}){return A(await this.transport.send(`jobs${Ar({state:e,from:t,limit:r})}`,{},n))}async result(e,t={}){let r=await this.transport.send(I(e,"result"),{},t);return new Blob([r.body],{type:r.contentType})}async report(e,t={}){return A(await this.transport.send(I(e,"report"),{},t))}async cancel(e,t={}){return A(await this.transport.send(I(e,"cancel"),{method:"POST"},t))}async retry(e,t={}){return A(await this.transport.send(I(e,"retry"),{method:"POST"},t))}async delete(e,t={}){await this.transport.send(I(e),{method:"DELETE"},t)}async*events(e,{lastVersion:t,signal:r}={}){let n=t;for(let i=yt.first;;){try{let s=await this.transport.open(I(e,"events"),{headers:n===void 0?{}:{"last-event-id":String(n)},signal:r??null});if(s.status===204||s.body===null)return;for await(let a of xr(s.body,oo)){let d=JSON.parse(a.data);if([n,i]=[d.version,yt.first],yield d,bt(d))return}}catch(s){if(oe(s)||r?.aborted||s instanceof w&&!io(s))throw s;i=Math.max(i,s instanceof w&&s.retryAfter||0)}await mt(i,r),i=Math.min(2*i,yt.longest)}}async wait(e,{onChange:t,...r}={}){for await(let n of this.events(e,r))if(t?.(n),bt(n))return n;return this.get(e,r)}};function bt(o){return o.state==="DONE"||o.state==="ERROR"||o.state==="CANCELLED"}function io({status:o}){return o===429||o>=500}function I(o,e){let t=`jobs/${encodeURIComponent(o)}`;return e===void 0?t:`${t}/${e}`}function Ar(o){let e=Object.entries(o).filter(([,r])=>r!==void 0),t=new URLSearchParams(e.map(([r,n])=>[r,String(n)])).toString();return t===""?"":`?${t}`}function gt(o,e){let t=/boundary="?([^";]+)"?/.exec(o)?.[1];if(!o.startsWith("multipart/mixed")||t===void 0)throw new Error(`multipart/mixed was asked for, ${o} was answered`);let r=new Uint8Array(e),n=new Map,i=0;for(;;){let s=so(r,`\r
\r
`,i);if(s<0){if(!new TextDecoder().decode(r.subarray(i)).startsWith(`--${t}--`))throw new Error("a multipart/mixed answer ends before its last line");return n}let a=new TextDecoder().decode(r.subarray(i,s)).toLowerCase(),d=Number(/content-length: *(\d+)/.exec(a)?.[1]??Number.NaN),c=/name="([^"]*)"/.exec(a)?.[1],l=s+4;if(!a.includes(`--${t.toLowerCase()}`)||c===void 0||!(l+d<=r.length))throw new Error("a part of a multipart/mixed answer cannot be read");let h=/content-type: *([^\r\n;]+)/.exec(a)?.[1]??"";n.set(c,{mediaType:h,body:r.slice(l,l+d)}),i=l+d+2}}function so(o,e,t){let r=[...e].map(i=>i.charCodeAt(0)),n=o.length-r.length;for(let i=t;i<=n;i+=1)if(r.every((s,a)=>o[i+a]===s))return i;return-1}function ae(o){return{method:"POST",headers:{"content-type":"application/json"},body:JSON.stringify(o)}}var $e=class{constructor(e,t){this.base=e;this.options=t;this.key=t.key}base;options;key;asked;send(e,t,r={}){return this.withKey(n=>pt(this.at(e),$r(t,n),r))}open(e,t){return this.withKey(r=>ft(this.at(e),$r(t,r)))}openPatiently(e,t,r){return Ae(r,()=>this.open(e,t))}upload(e,t,r,n={}){return this.withKey(i=>kr({url:this.at(e),headers:{...n,...vt(i)},body:t},r))}forget(e,t){fetch(this.at(e),{method:t,keepalive:!0,headers:vt(this.key)}).catch(()=>{})}async withKey(e){for(;;){let t=this.key;try{return await e(t)}catch(r){if(!(r instanceof w&&r.keyIsRefused))throw r;if(this.key===t){let n=await this.ask(r);if(n===void 0)throw r;this.key=n}}}}ask(e){return this.asked??=Promise.resolve(this.options.askForKey?.(e)).finally(()=>this.asked=void 0),this.asked}at(e){return new URL(e,this.base)}};function $r(o,e){return{...o,headers:{...o.headers,...vt(e)}}}function vt(o){return o===void 0?{}:{authorization:`Bearer ${o}`}}var de=class{constructor(e,t={}){this.base=e;this.transport=new $e(e,t),this.jobs=new se(this.transport)}base;jobs;transport;async info(){return A(await this.transport.send("info",{}))}async holes(e,t){let r=new FormData;return r.append("scan",e,"scan"),A(await this.transport.upload("holes",r,t))}async openSession(e,t,r){let n=new FormData;return n.append("scan",e,"scan"),n.append("constraints",new Blob([JSON.stringify(t)],{type:"application/json"}),"constraints"),A(await this.transport.upload("sessions",n,r))}async positions(e,t,r){let n=await this.inpaint(e,t,"application/octet-stream",r);return new Float32Array(n.body)}async draft(e,t,r){let n=await this.transport.send(`sessions/${e}/inpaint?draft=true`,ae(t),r);return new Float32Array(n.body)}async mend(e,t,r){let i=await this.inpaint(e,t,"multipart/mixed, application/octet-stream;q=0.9",r),{report:s,patches:a}=Mr(i);return{report:s,positions:new Float32Array(a.buffer)}}async patches(e,t,r){let n="multipart/mixed, model/gltf-binary;q=0.9",{report:i,patches:s}=Mr(await this.inpaint(e,t,n,r));return{report:i,glb:s.buffer}}async optimizeAnchor(e,t,r){return A(await this.transport.send(`sessions/${e}/optimize-anchor`,ae(t),r))}async anchorMap(e,t,r,n){let i=ae({...t,map:!0});i.headers={...i.headers,accept:"application/x-ndjson"},i.signal=n.signal??null;let s=({found:a,map:d,problem:c})=>{if(c!==void 0){let{status:l=500,code:h="",detail:p="",errors:u=[]}=c;throw new w(l,h,p,void 0,u)}a!==void 0&&r.onFound(a),d!==void 0&&r.onMap(d)};await Pr(await this.transport.openPatiently(`sessions/${e}/optimize-anchor`,i,n),s)}async result(e,t){let r=await this.transport.send(`sessions/${e}/result`,{},t);return new Blob([r.body],{type:r.contentType})}close(e){this.transport.forget(`sessions/${e}`,"DELETE")}inpaint(e,t,r,n){let i=ae(t);return i.headers={...i.headers,accept:r},this.transport.send(`sessions/${e}/inpaint`,i,n)}};function Mr(o){let e=gt(o.contentType,o.body),[t,r]=[e.get("report"),e.get("patches")];if(t===void 0||r===void 0)throw new Error("the answer has no report or no patches");return{report:JSON.parse(new TextDecoder().decode(t.body)),patches:r.body}}var Me=class{constructor(e,t){this.hole=e;this.target=t}hole;target;losses=Array.from({length:4096},()=>null);known=0;total;stopped=new AbortController;get signal(){return this.stopped.signal}get share(){return this.total===void 0?0:Math.min(this.known/Math.max(this.total,1),1)}get isComing(){return!this.signal.aborted&&(this.total===void 0||this.known<this.total)}add({cells:e=[],losses:t=[],total:r=0}){e.forEach((n,i)=>this.losses[n]=t[i]??null),this.known+=e.length,this.total=r}stop(){this.stopped.abort()}};function Ee(o){return Number.isInteger(o)&&o>=0&&o<8}function D(o){return`Fill ${o+1} of 8`}function wt(o,e){let t=xt(o,e),r=o===0?"the likeliest":"beside the likeliest";return t===void 0?`${D(o)}, ${r}.`:`${D(o)}. ${t}`}function xt(o,e){let t=e?.holes??[];if(!(o===0||t.length===0||t.some(({patch:r})=>(r?.alternative??0)>0)))return t.length===1?"A smooth surface closes this hole: it has one fill only, which is shown.":"Smooth surfaces close these holes: each has one fill only, which is shown."}var z=[["synthesize","Images of its own"],["continue","The scan\u2019s images go on"],["flat","One colour"],["none","Grey"]],kt="As darn decides";function Er(o){return o===void 0||z.some(([e])=>e===o)}function ce(o){let e=z.find(([t])=>t===o)?.[1]??kt;return`Colour of the new cloth: ${e.charAt(0).toLowerCase()}${e.slice(1)}`}var ao={synthesize:"synthesized",continue:"continued",flat:"flat",none:"none"};function Cr(o,e){let t=(e?.holes??[]).filter(i=>o!==void 0&&i.texture!==void 0&&i.texture.method!==ao[o]),r=t.map(({id:i})=>i).join(", "),n=t.length===0?"":` Not in ${t.length===1?"hole":"holes"} ${r}: see the report.`;return`${ce(o)}.${n}`}function Sr({method:o,reason:e="",width:t=0,height:r=0}){return`Its colour: ${new Map([["synthesized",`images of its own, ${t} \xD7 ${r} texels`],["continued","that of the scan goes on"],["flat","one, the mean of the cloth around the hole"],["none","grey"]]).get(o??"")??o}${e===""?"":`; ${e}`}.`}var co=["fill","except","maxDiameter","minDiameter"],Ce={anchors:[],edits:[],alternative:0,texture:void 0};function Tr({anchors:o,edits:e,...t},r,n){let i=({rimPositions:c=[]})=>c.join(),s=new Map(n.map(c=>[i(c),c.id??0])),a=new Map(r.map(c=>[c.id??0,s.get(i(c))])),d=c=>{let l=c.hole===void 0?void 0:a.get(c.hole);return c.hole===void 0?[c]:l===void 0?[]:[{...c,hole:l}]};return{anchors:o.flatMap(d),edits:e.flatMap(d),...t}}function q(o){return{...o.anchors.length>0&&{anchors:[...o.anchors]},...o.edits.length>0&&{edits:[...o.edits]},...o.alternative>0&&{alternative:o.alternative},...o.texture!==void 0&&{texture:o.texture}}}function Dr(o,{holes:e,made:t,acceptDoubtful:r,selection:n,more:i}){if(n!==void 0)return{...n,...i,...r&&{acceptDoubtful:r}};let s=h=>h.id??0,a=o.filter(P).map(s),c=[...o.filter(h=>!P(h)&&e.includes(s(h))).map(h=>({id:s(h)})),...t],l=a.filter(h=>!e.includes(h));return{...c.length>0&&{holes:c},...c.length>0&&l.length<a.length&&{fill:"holes"},...l.length>0&&{except:l},...i,...r&&{acceptDoubtful:r}}}function Lr(o,{holes:e,made:t,acceptDoubtful:r,selection:n,more:i},s){let a=e.filter(d=>o.some(c=>(c.id??0)===d));return{...n??{holes:[...a.map(d=>({id:d})),...t]},...i,...r&&{acceptDoubtful:r},...q(s)}}function Or(o){let e;try{e=JSON.parse(o)}catch(y){throw new Error(`The constraints are not JSON: ${y instanceof Error?y.message:String(y)}`)}if(typeof e!="object"||e===null||Array.isArray(e))throw new Error("The constraints must be a JSON object.");let{holes:t,acceptDoubtful:r=!1,anchors:n=[],edits:i=[],alternative:s=0,texture:a,...d}=e;if(!Pt(n)||!Pt(i))throw new Error("`anchors` and `edits` must be lists of objects.");if(typeof r!="boolean")throw new Error("`acceptDoubtful` must be true or false.");if(!Ee(s))throw new Error(`\`alternative\` must be a whole number from 0 to ${7}.`);if(!Er(a))throw new Error(`\`texture\` must be one of ${z.map(([y])=>y).join(", ")}.`);let c=y=>co.includes(y),l=Object.entries(d),h=Object.fromEntries(l.filter(([y])=>c(y))),p=Object.fromEntries(l.filter(([y])=>!c(y))),{isOwn:u,...f}=lo(t),g=u&&Object.keys(h).length===0?void 0:{...t!==void 0&&{holes:t},...h};return{...f,acceptDoubtful:r,selection:g,more:p,constraints:{anchors:n,edits:i,alternative:s,texture:a}}}function Rr({holes:o,made:e,acceptDoubtful:t,selection:r,more:n},i,s){let a=s.filter(P).map(c=>c.id??0);return{holes:[...o??(i.holes.length>0?i.holes:a)].sort((c,l)=>c-l),made:e,acceptDoubtful:t,selection:r,more:n}}function lo(o){if(o===void 0)return{holes:void 0,made:[],isOwn:!0};if(!Pt(o))throw new Error("`holes` must be a list of objects.");let e=[],t=[],r=!0;for(let n of o)typeof n.id=="number"&&Number.isInteger(n.id)?e.push(n.id):typeof n.cut=="object"?t.push({cut:n.cut}):n.border==="auto"?t.push({border:{auto:!0}}):typeof n.border=="object"?t.push({border:n.border}):r=!1;return{holes:e,made:t,isOwn:r}}function Pt(o){return Array.isArray(o)&&o.every(e=>typeof e=="object"&&e!==null)}var Se={label:"Open",holes:[],made:[],acceptDoubtful:!1,selection:void 0,more:{},constraints:Ce,patches:[],cutFaces:[],report:void 0};var uo="darn reconstruction";function Te(o){return o.byteLength>=20&&new TextDecoder().decode(o.slice(0,4))==="glTF"}function $t(o){return o.slice(20,20+new DataView(o).getUint32(12,!0))}function K(o){let e=Te(o)?$t(o):o;try{return JSON.parse(new TextDecoder().decode(e))}catch{return{}}}function De({images:o=[],meshes:e=[]}){let t=e.flatMap(({primitives:r=[]})=>r.flatMap(n=>Object.keys(n.attributes??{})));return o.length>0||t.some(r=>r.startsWith("COLOR_"))}function Fr({meshes:o=[],materials:e=[]},t){let r=new Map;for(let[n,i]of t.entries()){let{name:s,pbrMetallicRoughness:a}=e[o[n]?.primitives?.[0]?.material??-1]??{};if(s!==uo||a===void 0||a.baseColorTexture!==void 0)continue;let{baseColorFactor:d=[1,1,1],roughnessFactor:c=1,metallicFactor:l=1}=a;r.set(i,{color:d.slice(0,3),roughness:c,metalness:l})}return r}var le=class{states;at=0;constructor(e){this.states=[e]}get present(){return this.states[this.at]}get canUndo(){return this.at>0}get canRedo(){return this.at+1<this.states.length}get next(){return this.states[this.at+1]}push(e){this.states.length=this.at+1,this.states.push(e),this.at+=1}undo(){this.at=Math.max(this.at-1,0)}redo(){this.at=Math.min(this.at+1,this.states.length-1)}};var ho="The cloth around it cannot be laid flat: a fair surface without folds, which takes no gestures.",po=1.645;function Br(o){let e=o.patch??{},t=(e.faces??0).toLocaleString("en"),r=e.alternative??0,n=[`Hole ${o.id}: ${t} new triangles, area ${b(e.area)}, on a rim of length ${b(o.length)}.`,`${fo(e.stretchMean,e.stretchMax)} ${mo(e.selfIntersections??0)}`,e.method==="fair"?ho:yo(e.networkShare),r>0?wt(r):"",o.texture===void 0?"":Sr(o.texture),bo(e.confidence,(o.anchors??[]).length+(o.edits??[]).length)];if(o.cut!==void 0&&(o.cut.faces??0)>0){let i=(o.cut.faces??0).toLocaleString("en");n.push(`${i} triangles of the scan were cut out first, area ${b(o.cut.area)}.`)}for(let i of o.anchors??[]){let s=i.beyondReach??0,a=s>0?`; ${b(s)} of that is beyond the cloth's reach`:"";n.push(`An anchor is ${b(i.distance)} away from the cloth${a}.`)}for(let i of o.edits??[])n.push(`A gesture is followed to within ${b(i.distance)}.`);return[...n,...(o.doubts??[]).map(i=>`Doubtful: ${i}.`),...o.notes??[]].filter(i=>i!=="")}function Nr(o){let e=o.holes?.length??0,t=o.skipped?.length??0,r=t===1?"1 loop is":`${t} loops are`;return`${Ir(e,"hole")} filled; ${r} left open.`}function Hr({label:o,constraints:e,patches:t,report:r}){if(o===D(e.alternative))return wt(e.alternative,r);if(o===ce(e.texture))return Cr(e.texture,r);let n=t.reduce((i,s)=>i+(s.hole.patchFaces?.length??0)/3,0);return`${o}: ${t.length} filled, ${n.toLocaleString("en")} new triangles.`}function fo(o,e){return o===void 0||e===void 0?"":`Lengths differ from those of flat cloth by ${Mt(o-1)} on average, ${Mt(e-1)} at most.`}function mo(o){return o===0?"No triangles cross.":`${Ir(o,"pair")} of triangles cross.`}function yo(o){return o===void 0?"":o>=.995?"The network predicts its folds.":o<=.005?"A fair surface without folds, as the cloth around it has none.":`${Mt(o)} of the network's folds, for the rest a fair surface.`}function bo(o,e){if(o?.median===void 0)return"";let r=[["very high",o.veryHigh],["high",o.high],["medium",o.medium],["low",o.low],["very low",o.veryLow]].map(([s,a=0])=>[s,Math.round(100*a)]).filter(([,s])=>s>0).map(([s,a])=>`${s} at ${a} %`),n=e>0?"Before anchors and gestures, half":"Half",i=b(po*o.median);return`${n} of the new vertices have nine chances in ten to lie within ${i} of the cloth that was there; confidence is ${r.join(", ")} of the vertices.`}function Mt(o){return`${Number((Math.abs(o)*100).toPrecision(2))} %`}function Ir(o,e){return`${o} ${e}${o===1?"":"s"}`}var go=/\.(glb|gltf)$/i,vo=[[/\.png$/i,"image/png"],[/\.jpe?g$/i,"image/jpeg"],[/\.webp$/i,"image/webp"]];async function Vr(o){let e=o.find(({name:n})=>go.test(n))??o[0];if(e===void 0)return;let{name:t}=e;if(!/\.gltf$/i.test(t))return{file:e,name:t};let r;try{r=JSON.parse(await e.text())}catch{return{file:e,name:t}}for(let n of[...r.buffers??[],...r.images??[]])n.uri!==void 0&&!n.uri.startsWith("data:")&&(n.uri=await xo(wo(o,n.uri),n));return{file:new Blob([JSON.stringify(r)],{type:"model/gltf+json"}),name:t}}function J(o="scan"){return o.replace(/\.(glb|gltf)$/i,"")}async function Ur(o,e){let t=await fetch(o,{signal:e??null});if(!t.ok)throw new Error(`${o.href} answered with status ${t.status}.`);return new Blob([await t.arrayBuffer()],{type:"model/gltf-binary"})}function wo(o,e){let t=decodeURIComponent(e).split("/").pop(),r=o.find(({name:n})=>n===t);if(r===void 0)throw new Error(`The scan refers to the file ${t}; drop both together.`);return r}async function xo(o,e){let t=vo.find(([s])=>s.test(o.name))?.[1],r=e.mimeType??t??"application/octet-stream",n=new Uint8Array(await o.arrayBuffer()),i="";for(let s=0;s<n.length;s+=32768)i+=String.fromCharCode(...n.subarray(s,s+32768));return`data:${r};base64,${btoa(i)}`}var Le=class{constructor(e,t){this.service=e;this.scan=t}service;scan;opened;get skipped(){return this.opened?.cloth.skipped??[]}get cutFaces(){return this.opened?.cloth.cutFaces??[]}async holes(e,t){return(await this.open(e,t)).cloth.holes}async mend(e,t,r){let n=await this.open(e,r),i=await this.dress(n,t.texture,r),{patches:s,report:a}=await n.cloth.mend(q(t),r);return{patches:_r(s,i),report:ko(a,i)}}async preview(e,t){let r=await this.open(e,{}),n=await this.dress(r,t.texture,{});return _r(await r.cloth.draft(q(t)),n)}async optimizeAnchor(e,t,r){return(await this.open(e,r)).cloth.optimizeAnchor(t,r)}async anchorMap(e,t,r,n){await(await this.open(e,n)).cloth.anchorMap(t,r,n)}async result(e,t,r){return(await this.open(e,r)).cloth.result(q(t),r)}close(){this.opened?.cloth.close(),this.opened=void 0}async open(e,t){let r=jr(e);if(this.opened!==void 0&&[this.opened.asked,this.opened.filled].includes(r))return this.opened;let{file:n,loops:i}=this.scan,s=await ie.open(this.service,n,Dr(i,e),t);this.close();let a=jr({...e,holes:s.holes.map(({id:d=0})=>d)});return this.opened={asked:r,filled:a,cloth:s,dressings:new Map},this.opened}async dress({cloth:e,dressings:t},r,n){let i=t.get(r);if(i!==void 0)return i;let s=q({...Ce,texture:r}),a=await e.positions(s,n),{glb:d,report:c}=await e.patches(s,n),l=c.holes??[],h=De(this.scan.document)?l:[],p={glb:d,positions:new Map(a.map(u=>[u.hole.id??0,u.positions])),textures:new Map(h.flatMap(({id:u=0,texture:f})=>f===void 0?[]:[[u,f]])),colours:Fr(K(d),l.map(({id:u=0})=>u))};return t.set(r,p),p}};function jr({holes:o,made:e,acceptDoubtful:t,selection:r,more:n}){return JSON.stringify([o,e,t,r,n])}function _r(o,e){return o.map(t=>({...t,dressing:e}))}function ko(o,{textures:e}){let t=(o.holes??[]).map(r=>{let n=e.get(r.id??0);return n===void 0?r:{...r,texture:n}});return{...o,holes:t}}var Oe=class{constructor(e){this.varied=e}varied;wanted;get isWaiting(){return this.wanted!==void 0}get newest(){return this.wanted??this.varied.step().constraints}async choose(e){let{isWaiting:t,varied:r}=this,{alternative:n,texture:i}=this.newest;if(this.wanted={alternative:n,texture:i,...e},t)return;let s;for(;r.step()!==s&&!r.isBusy();){s=r.step();let a=Po(s.constraints,this.wanted);a!==void 0&&await r.apply(a.label,a.constraints)}this.wanted=void 0}};function Po(o,{alternative:e,texture:t}){if(e!==o.alternative)return{label:D(e),constraints:{...o,alternative:e}};if(t!==o.texture)return{label:ce(t),constraints:{...o,texture:t}}}var Re=class extends EventTarget{constructor(t){super();this.service=t;this.limits=t.info().catch(()=>{})}service;scan;chosen=new Set;acceptDoubtful=!1;skipped=[];tool="look";draft;draftPatches;found;map;work;problem;message="";history=new le(Se);session;live=new H;wanted=new Oe({step:()=>this.step,isBusy:()=>this.work!==void 0,apply:(t,r)=>this.apply(t,this.step,r)});limits;get step(){return this.history.present}get editable(){return this.step.patches.filter(te)}get alternative(){return this.wanted.newest.alternative}get texture(){return this.wanted.newest.texture}get canVary(){return this.step.patches.length>0&&(this.work===void 0||this.wanted.isWaiting)}get patches(){return this.draftPatches??this.step.patches}get undoLabel(){return this.history.canUndo?this.history.present.label:void 0}get redoLabel(){return this.history.next?.label}reportOf(t){return this.step.report?.holes?.find(r=>r.id===t)}async open(t,r){await this.working(`Sending ${r}`,async n=>{let i=(await this.limits)?.limits.bodyBytes;if(i!==void 0&&t.size+4096>i)throw new Error(`${r} has ${t.size} bytes; this service takes at most ${i}.`);let s=await t.arrayBuffer(),{loops:a=[],candidates:d=[],notes:c=[]}=await this.service.holes(t,n);this.session?.close(),this.scan={file:t,name:r,bytes:s,loops:a,candidates:d,notes:c,document:K(s)},this.session=new Le(this.service,this.scan),this.history=new le(Se),this.chosen=new Set(a.filter(P).map(h=>h.id??0)),this.skipped=[],this.acceptDoubtful=!1,this.found=void 0,this.dropMap(),this.dropDraft();let l=this.chosen.size;this.message=`${r} is open: ${l} ${l===1?"hole":"holes"} in ${a.length} boundary loops.`,this.dispatchEvent(new Event("opened"))})}async openAddress(t){let r=decodeURIComponent(t.pathname.split("/").pop()??"")||t.host,n;await this.working(`Loading ${r}`,async({signal:i})=>{n=await Ur(t,i)}),n!==void 0&&await this.open(n,r)}choose(t){this.chosen=t,this.changed()}setAcceptDoubtful(t){this.acceptDoubtful=t,this.changed()}async mend(){let t=[...this.chosen].sort((i,s)=>i-s),r=`${t.length} ${t.length===1?"hole":"holes"}`,{acceptDoubtful:n}=this;await this.fill(`Mend ${r}`,{...this.step,holes:t,acceptDoubtful:n,selection:void 0})}async make(t,r){let{step:n}=this;await this.fill(t,{...n,made:[...n.made,r],selection:void 0})}async unmake(t){let{step:r}=this,n=r.made.filter(s=>s!==t),i=r.holes.filter(s=>this.scan?.loops.some(a=>a.id===s));i.length+n.length===0?(this.history.push({...Se,label:"Put back"}),this.say("Put back: nothing is mended.")):await this.fill("Put back",{...r,holes:i,made:n,selection:void 0})}preview(t){this.draft=t,this.changed(),ut(this.step.constraints,t)!==void 0&&this.live.offer(async()=>{let{step:r,session:n}=this,i=ut(r.constraints,t);if(!(this.draft!==t||n===void 0||i===void 0))try{let s=await n.preview(r,i);this.draft!==void 0&&this.step===r&&(this.draftPatches=s,this.changed())}catch(s){this.report(s)}})}async commit(){let{draft:t}=this;if(t!==void 0)if(E(t))await this.make($[t.kind],gr(t));else if(t.kind==="anchor"&&t.uv!==void 0)await this.apply("Move anchor",this.step,xe(this.step.constraints,t,t.uv));else if(t.kind==="anchor")await this.placeAnchor(t);else{let r=lt(this.step.constraints,t);await this.apply($[t.kind],this.step,r)}}dropDraft(){this.draft=void 0,this.draftPatches=void 0,this.changed()}async chooseFill(t){Ee(t)&&await this.vary({alternative:t})}async vary(t){if(this.canVary){let r=this.wanted.choose(t);this.changed(),await r,this.changed()}}async findAnchor({hole:t,position:r}){let n;return await this.working("Searching",async i=>{let s={hole:t,target:[...r]},a=await this.session?.optimizeAnchor(this.step,s,i);a!==void 0&&(n={hole:t,found:a},this.found=n,this.message=`Found after ${a.evaluations} evaluations of the network.`)}),n}async drawMap({hole:t,position:r}){this.stopMap();let n=new Me(t,r);this.map=n,this.problem=void 0,this.say("The map is being drawn.");try{let i={onFound:a=>{this.found={hole:t,found:a},this.changed()},onMap:a=>{n.add(a),this.changed()}},s={hole:t,target:[...r]};await this.session?.anchorMap(this.step,s,i,{signal:n.signal}),this.say("The map is complete.")}catch(i){n.stop(),this.report(i)}}stopMap(){this.map?.isComing&&(this.map.stop(),this.say("The map is stopped."))}dropMap(){this.map?.stop(),this.map=void 0}async placeAnchor(t){this.map!==void 0&&this.map.target.join()!==t.position.join()&&this.dropMap();let r=(await this.findAnchor(t))?.found.uv;if(r!==void 0){let n=xe(this.step.constraints,t,r);await this.apply(t.hard?"Hard anchor":$.anchor,this.step,n)}}undo(){this.travel(()=>this.history.undo(),"Undone")}redo(){this.travel(()=>this.history.redo(),"Redone")}setTool(t){this.tool=t,this.dropDraft()}constraintsText(){let t=Lr(this.scan?.loops??[],this.step,this.step.constraints);return JSON.stringify(t,void 0,2)}async loadConstraints(t){let r;try{r=Or(t)}catch(i){this.report(i);return}let n=Rr(r,this.step,this.scan?.loops??[]);this.acceptDoubtful=n.acceptDoubtful,await this.apply("Load constraints",n,r.constraints),this.choose(new Set(this.step.holes))}async result(){let t;return await this.working("Saving",async r=>{let{holes:n,constraints:i}=this.step;t=await this.session?.result(this.step,i,r),this.message=`Saved with ${n.length} filled ${n.length===1?"hole":"holes"}.`}),t}say(t){this.message=t,this.changed()}report(t){oe(t)||(this.problem=ht(t),this.changed())}clearProblem(){this.problem=void 0,this.changed()}async fill(t,r){let{step:n,draft:i}=this;await this.working(t,async s=>{let{session:a}=this;if(a!==void 0){let d=await a.holes(r,s),c=Tr(n.constraints,n.patches.map(l=>l.hole),d);await this.take(t,{choice:r,constraints:c},s),this.dispatchEvent(new Event("mended"))}}),(this.step!==n||i===void 0||!E(i))&&this.dropDraft()}async apply(t,r,n){await this.working(t,async i=>{(r.selection!==void 0||r.holes.length+r.made.length>0)&&(await this.take(t,{choice:r,constraints:n},i),this.dispatchEvent(new Event("edited")))}),this.dropDraft()}async take(t,{choice:r,constraints:n},i){let{session:s}=this;if(s===void 0)return;let{patches:a,report:d}=await s.mend(r,n,i),{skipped:c,cutFaces:l}=s;this.skipped=c;let h=a.map(x=>x.hole.id??0),{made:p,acceptDoubtful:u,selection:f,more:g}=r,y={holes:h,made:p,acceptDoubtful:u,selection:f,more:g};this.history.push({label:t,...y,constraints:n,patches:a,cutFaces:l,report:d}),this.message=Hr(this.history.present)}travel(t,r){let n=this.step;this.work===void 0&&(t(),this.step!==n&&(this.message=`${r}. Now: ${this.step.label}.`,this.found=void 0,this.dropMap(),this.problem=void 0),this.dropDraft())}async working(t,r){this.work?.stop.abort();let n=new AbortController,i=(s,a)=>{n.signal.aborted||(this.work={label:s,share:a,stop:n},this.changed())};this.problem=void 0,i(t,void 0);try{await this.live.settled(),await r({signal:n.signal,onSent:s=>i(s<1?t:"Computing",s<1?s:void 0),onWait:s=>i(`The service is busy; waiting ${s} s`,void 0)})}catch(s){this.report(s)}finally{this.work?.stop===n&&(this.work=void 0),this.changed()}}changed(){this.dispatchEvent(new Event("change"))}};var Fe=[["blended","Reconstruction blended","Like the cloth around it"],["marked","Reconstruction marked","Marked by glowing stripes"]],Wr="KHR_materials_variants";async function Gr(o,e){if(!o.type.startsWith("model/gltf"))return o;let t=await o.arrayBuffer(),r=Te(t)?$t(t):new Uint8Array(t),n=JSON.parse(new TextDecoder().decode(r));if(!Ao(n,e))return o;let[i,{type:s}]=[JSON.stringify(n),o];return Te(t)?$o(i,t.slice(20+r.byteLength),s):new Blob([i],{type:s})}function Ao(o,e){let t=Fe.find(([i])=>i===e)?.[1],r=o.extensions?.[Wr]?.variants?.findIndex(i=>i.name===t)??-1,n=!1;for(let i of o.meshes?.flatMap(({primitives:s=[]})=>s)??[]){let a=(i.extensions?.[Wr]?.mappings??[]).find(({variants:d=[]})=>d.includes(r))?.material;a!==void 0&&a!==i.material&&(i.material=a,n=!0)}return n}function $o(o,e,t){let r=new TextEncoder().encode(o),n=new Uint8Array((4-r.length%4)%4).fill(32),i=r.length+n.length,s=new DataView(new ArrayBuffer(20));return[1179937895,2,20+i+e.byteLength,i,1313821514].forEach((d,c)=>s.setUint32(4*c,d,!0)),new Blob([s,r,n,e],{type:t})}import{Box3 as ki,DirectionalLight as Pi,HemisphereLight as Ai,OrbitControls as $i,PerspectiveCamera as Mi,Plane as Ei,Raycaster as Ci,Scene as Si,Sphere as Vt,Vector2 as Ti,Vector3 as C,WebGLRenderer as Di}from"./vendor.js";function qr(o,{from:e,to:t},r){let n;for(let u of o){let f=Ct(u),{at:g,distance:y}=zr(f,e);y<(n?.distance??Number.POSITIVE_INFINITY)&&(n={points:f,at:g,distance:y})}if(n===void 0)return[];let{points:i,at:s}=n,a=zr(i,t).at,d=i.length,c=u=>{let f=[i[s]];for(let g=s;g!==a;)g=(g+u+d)%d,f.push(i[g]);return f},[l,h]=[c(1),c(-1)],p=u=>r===void 0?Eo(u):Mo(u,r);return p(l)<=p(h)?l:h}function Ct({points:o}){return Array.from({length:o.length/3},(e,t)=>[...o.subarray(3*t,3*t+3)])}function zr(o,e){let t={at:0,distance:Number.POSITIVE_INFINITY};return o.forEach((r,n)=>{let i=St(r,e);i<t.distance&&(t={at:n,distance:i})}),t}function Mo(o,{from:e,to:t}){let r=[0,1,2].map(s=>t[s]-e[s]),n=r[0]**2+r[1]**2+r[2]**2;return o.map(s=>{let a=r.reduce((c,l,h)=>c+l*(s[h]-e[h]),0),d=n>0?Math.min(Math.max(a/n,0),1):0;return St(s,e.map((c,l)=>c+d*r[l]))}).reduce((s,a)=>s+a,0)/o.length}function Eo(o){return o.reduce((e,t,r)=>e+St(t,o[Math.max(r-1,0)]),0)}function St(o,e){return Math.hypot(o[0]-e[0],o[1]-e[1],o[2]-e[2])}function Kr(o,e){let t=new Set(e),r=new Map;for(let n of o){let{centroid:i=[],length:s=0}=n,a;for(let d of t){let l=(Math.hypot(...d.centroid.map((h,p)=>h-(i[p]??0)))+Math.abs(d.length-s))/(s||1);l<(a?.cost??.05)&&(a={line:d,cost:l})}a!==void 0&&(t.delete(a.line),r.set(n.id??0,a.line))}return r}import{BufferAttribute as Co,BufferGeometry as So,DoubleSide as Jr,Group as To,Line as Yr,Line2 as rn,LineBasicMaterial as Do,LineGeometry as Lo,LineLoop as Oo,LineMaterial as Ro,Mesh as Be,MeshBasicMaterial as Tt,SphereGeometry as Fo,Vector3 as Dt}from"./vendor.js";var Bo=7,Xr=64,Ne=750213,Qr=12723548,Zr="cut",en="twist",He=class{group=new To;ball=new Fo(1,24,16);ballMaterial=new Tt({color:Ne,depthTest:!1,transparent:!0});cutMaterial=new Tt({color:Qr,transparent:!0,opacity:.35,depthWrite:!1,side:Jr});diskMaterial=new Tt({color:Ne,transparent:!0,opacity:.3,depthTest:!1,side:Jr});lineMaterial=new Do({color:Ne,depthTest:!1,transparent:!0});show({handles:e=[],tethers:t=[],ring:r=[],disk:n,ball:i,stretches:s=[],dashes:a=[]}){if(this.clear(),i!==void 0){let d=new Be(this.ball,this.cutMaterial);d.position.copy(i.center),d.scale.setScalar(i.radius),d.name=Zr,this.group.add(d)}if(n!==void 0){let d=new Be(No(n.center,n.ring),this.diskMaterial);d.name=en,this.group.add(d)}for(let d of s.filter(c=>c.length>1))this.group.add(tn(d,{color:Qr,linewidth:6}));for(let d of a.filter(c=>c.length>1)){let c=d.reduce((h,p,u)=>h+p.distanceTo(d[Math.max(u-1,0)]??p),0),l={dashed:!0,dashSize:c/30,gapSize:c/40};this.group.add(tn(d,{color:Ne,linewidth:3,...l}))}for(let d of e){let c=new Be(this.ball,this.ballMaterial);c.position.copy(d),this.group.add(c)}for(let d of t)this.group.add(new Yr(Lt(d),this.lineMaterial));r.length>0&&this.group.add(new Oo(Lt(r),this.lineMaterial)),this.group.children.forEach(d=>d.renderOrder=10)}clear(){for(let e of this.group.children)e instanceof rn?(e.geometry.dispose(),e.material.dispose()):(e instanceof Yr||e.name===en)&&e.geometry.dispose();this.group.clear()}fit(e,t){let r=2*Math.tan(e.fov*Math.PI/360)/Math.max(t,1);for(let n of this.group.children)n instanceof Be&&n.geometry===this.ball&&n.name!==Zr&&n.scale.setScalar(Bo*r*e.position.distanceTo(n.position))}};function nn(o,e,t){let n=(Math.abs(e.x)<.9?new Dt(1,0,0):new Dt(0,1,0)).cross(e).normalize(),i=new Dt().crossVectors(e,n).normalize();return Array.from({length:Xr},(s,a)=>{let d=2*Math.PI*a/Xr;return o.clone().addScaledVector(n,t*Math.cos(d)).addScaledVector(i,t*Math.sin(d))})}function No(o,e){let t=e.flatMap((r,n)=>[o,r,e[(n+1)%e.length]??r]);return Lt(t)}function tn(o,e){let t=new Lo;t.setPositions(o.flatMap(n=>n.toArray()));let r=new rn(t,new Ro({depthTest:!1,transparent:!0,...e}));return r.computeLineDistances(),r}function Lt(o){let e=new Float32Array(o.flatMap(t=>t.toArray()));return new So().setAttribute("position",new Co(e,3))}import{BufferAttribute as Mn,Color as li,DoubleSide as Sn,GLTFLoader as ui,Mesh as Tn,MeshStandardMaterial as Nt,Triangle as hi,Vector3 as En}from"./vendor.js";var Ho=3.2*Math.PI;function an(o,e,t){let r=o.length/3,n=new Float64Array(r),i=new Float64Array(r),s=new Float32Array(3*r),a=new Int32Array(r);on(e,t,([p,u,f])=>{let g=Vo(o,p,u,f),y=Math.hypot(...g);for(let[x,sr,ar]of[[p,u,f],[u,f,p],[f,p,u]]){n[x]=n[x]+Math.atan2(y,Uo(o,x,sr,ar)),i[x]=i[x]+y/6,a[x]=a[x]+sn(sr)-sn(ar)|0;for(let ee=0;ee<3;ee+=1)s[3*x+ee]=s[3*x+ee]+g[ee]}});let d=n.map((p,u)=>a[u]!==0||p===0?(i[u]=0,0):p>Ho?(i[u]=i[u]/2,2*Math.PI-p/2):2*Math.PI-p),c=new Float64Array(2*r);on(e,t,([p,u,f])=>{let g=d[p]+d[u]+d[f],y=i[p]+i[u]+i[f];for(let x of[p,u,f])c[2*x]=c[2*x]+g,c[2*x+1]=c[2*x+1]+y});let l=new Float32Array(r),h=new Float32Array(r);for(let p=0;p<r;p+=1){let u=t[p],f=c[2*u+1];l[p]=f>0?c[2*u]/f:Number.NaN,h[p]=Io(s.subarray(3*u,3*u+3))}return{curvature:l,shade:h}}var Ot=[.39,.49,.78];function Io([o=0,e=0,t=0]){let r=Math.hypot(o,e,t)||1;return Math.abs(o*Ot[0]+e*Ot[1]+t*Ot[2])/r}function on(o,e,t){let r=n=>e[o[n]];for(let n=0;n+2<o.length;n+=3){let[i,s,a]=[r(n),r(n+1),r(n+2)];i!==s&&s!==a&&a!==i&&t([i,s,a])}}function sn(o){let e=Math.imul(o+1,2654435761);return e^e>>>15}function Vo(o,e,t,r){let n=(h,p)=>o[3*h+p]-o[3*e+p],[i,s,a,d,c,l]=[n(t,0),n(t,1),n(t,2),n(r,0),n(r,1),n(r,2)];return[s*l-a*c,a*d-i*l,i*c-s*d]}function Uo(o,e,t,r){let n=(i,s)=>o[3*i+s]-o[3*e+s];return n(t,0)*n(r,0)+n(t,1)*n(r,1)+n(t,2)*n(r,2)}function dn({hole:o,positions:e}){let{patchDeviations:t=[]}=o,r=e.length/3;return t.length===r?new Float32Array(t):new Float32Array(r).fill(Number.NaN)}var Ie=[[.02,.19,.38],[.13,.4,.67],[.57,.77,.87],[.97,.97,.97],[.99,.72,.39],[.88,.51,.08],[.5,.23,.03]],ln=[[1,.97,.74],[1,.85,.4],[.98,.62,.2],[.85,.38,.08],[.58,.2,.04],[.3,.08,.03]],jo={stretch:Ie,curvature:Ie,confidence:ln},un=[.42,.44,.47],hn=[.725,.745,.775],cn=.3,L=1024,_o={stretch:Rt(Ie),curvature:Rt(Ie),confidence:Rt(ln)},pn=Float32Array.from({length:L+1},(o,e)=>(1-cn+cn*e/L)**2.2);function Ve(o,e,t){let r=new Float32Array(3*o.length),n=_o[t.heat];for(let i=0;i<o.length;i+=1){let s=Wo(o[i],t),a=pn[Math.round(L*e[i])],d=Number.isFinite(s)?Math.round(L*Math.min(Math.max(s,0),1)):L+1;for(let c=0;c<3;c+=1)r[3*i+c]=n[3*d+c]*a}return r}function Wo(o,{heat:e,most:t}){switch(e){case"stretch":return(Math.log(o)/Math.log(1+t)+1)/2;case"curvature":return(o/t+1)/2;case"confidence":return o===0?0:o/t}}function fn(o){let e=hn.map(gn),t=new Float32Array(3*o.length);for(let r=0;r<t.length;r+=1){let n=pn[Math.round(L*o[Math.floor(r/3)])];t[r]=e[r%3]*n}return t}function Ft(o){return`linear-gradient(to right, ${jo[o].map(Bt).join()})`}var mn=Bt(un),yn=Bt(hn);function bn(o,e){if(o==="confidence"){let i=e.flatMap(s=>[...s]).reduce((s,a)=>a>s?a:s,-1);return{heat:o,most:i<0?Number.NaN:i}}let t=[];for(let i of e){let s=Math.max(1,Math.floor(i.length/2e4));for(let a=0;a<i.length;a+=s){let d=i[a],c=o==="stretch"?Math.exp(Math.abs(Math.log(d)))-1:Math.abs(d);Number.isFinite(c)&&t.push(c)}}t.sort((i,s)=>i-s);let r=t[Math.floor(.95*t.length)]??0,n=o==="stretch"?.02:Number.MIN_VALUE;return{heat:o,most:Go(Math.max(r,n))}}function Go(o){let e=10**Math.floor(Math.log10(o)),t=[1,2,5,10].find(r=>r*e>=o*.9999)??10;return Number((t*e).toPrecision(1))}function Bt(o){return`rgb(${o.map(e=>Math.round(255*e)).join()})`}function Rt(o){let e=Array.from({length:L+1},(t,r)=>zo(o,r/L));return Float32Array.from([...e,un].flatMap(t=>t.map(gn)))}function zo(o,e){let t=e*(o.length-1),r=Math.min(Math.floor(t),o.length-2),[n,i]=[o[r],o[r+1]];return n.map((s,a)=>s+(i[a]-s)*(t-r))}function gn(o){return o<=.04045?o/12.92:((o+.055)/1.055)**2.4}import{Box3 as Qo,BufferAttribute as kn,DoubleSide as xn,Mesh as Zo,MeshBVH as ei,MeshBasicMaterial as ti,MeshStandardMaterial as ri,Vector3 as ue,acceleratedRaycast as ni}from"./vendor.js";var Ue=class{constructor(e,t){this.slack=t;let r=i=>e[3*i],n=Array.from({length:e.length/3},(i,s)=>s).sort((i,s)=>r(i)-r(s));this.sorted=Float64Array.from(n.flatMap(i=>e.slice(3*i,3*i+3)))}slack;sorted;has(e,t,r){let{sorted:n,slack:i}=this,[s,a]=[0,n.length/3];for(;s<a;){let d=s+a>>1;n[3*d]<e-i?s=d+1:a=d}for(let d=3*s;d<n.length&&n[d]<=e+i;d+=3)if(Math.abs(n[d+1]-t)<=i&&Math.abs(n[d+2]-r)<=i)return!0;return!1}};function vn(o,e,t){let r,n=(i,s)=>o[3*i+s];for(let i=0;i+2<e.length;i+=3){let[s,a,d]=[e[i],e[i+1],e[i+2]],c=l=>(n(s,l)+n(a,l)+n(d,l))/3;t.has(c(0),c(1),c(2))&&(r??=e.slice(),r.fill(e[i],i,i+3))}return r}var _e=class{worker;waiting=new Map;nextId=0;async boundary(e){let t=await this.ask({...e,job:"boundary"});return"lines"in t?t.lines:je(t)}async tree(e){let t=await this.ask({...e,job:"tree"});return"tree"in t?t.tree:je(t)}async numbers(e){let t=await this.ask({...e,job:"numbers"});return"numbers"in t?t.numbers:je(t)}async stretch(e,t){let r=await this.ask({...e,job:"stretch",cells:t});return"stretch"in r?r.stretch:je(r)}stop(){this.worker?.terminate(),this.worker=void 0;for(let[e,t]of this.waiting)t({id:e,error:"stopped"});this.waiting.clear()}ask(e){this.worker??=this.start();let t=this.nextId;this.nextId+=1;let r=new Promise(n=>this.waiting.set(t,n));return this.worker.postMessage({...e,id:t},[e.positions.buffer,e.triangles.buffer]),r}start(){let e=new Worker(qo(),{type:"module"});return e.onmessage=({data:t})=>{this.waiting.get(t.id)?.(t),this.waiting.delete(t.id)},e.onerror=()=>this.stop(),e}};function qo(){let o=new URL("./worker.js",import.meta.url);if(o.origin===location.origin)return o;let e=`import ${JSON.stringify(o.href)};`;return URL.createObjectURL(new Blob([e],{type:"text/javascript"}))}function je(o){throw new Error("error"in o?o.error:"the worker answered something else")}import{DRACOLoader as Ko,GLTFLoader as Jo,MeshoptDecoder as Yo}from"./vendor.js";var Xo="KHR_draco_mesh_compression";async function wn(o){let e=new Jo().setMeshoptDecoder(Yo),{extensionsUsed:t=[]}=K(o);if(!t.includes(Xo))return(await e.parseAsync(o,"")).scene;let{DECODER:r}=await import("./draco.js"),[n,i]=[r.script,r.wasm].map(a=>URL.createObjectURL(new Blob([a]))),s=new Ko().setDecoderPath({js:n,wasm:i});try{return(await e.setDRACOLoader(s).parseAsync(o,"")).scene}finally{s.dispose(),URL.revokeObjectURL(n),URL.revokeObjectURL(i)}}function O(o){return o==="textured"||o==="shaded"||o==="wireframe"?void 0:o}var oi=12172998;function Ge(o,e){return O(e)!==void 0?new ti({vertexColors:!0,side:xn}):new ri({color:o,roughness:.85,side:xn,wireframe:e==="wireframe"})}var We=class o{constructor(e){this.root=e;e.updateMatrixWorld(!0),this.bounds=new Qo().setFromObject(e),e.traverse(t=>{t instanceof Zo&&(this.own.set(t,t.material),"isSkinnedMesh"in t||(t.raycast=ni))})}root;own=new Map;jobs=new _e;bounds;plain;numbersAsked;ownColors=new Map;middles=[];lists=new Map;static async load(e){return new o(await wn(e))}get meshes(){return[...this.own.keys()]}setShading(e){O(e)===void 0&&this.unpaint(),this.plain?.dispose();let t=e==="textured"?void 0:Ge(oi,e);this.plain=t;for(let[r,n]of this.own)r.material=t??n}materialNear(e){let t,r=new ue;for(let[n,i]of this.own){let s=n.geometry.getAttribute("position");for(let a=0;a<s.count;a+=1){let d=r.fromBufferAttribute(s,a).applyMatrix4(n.matrixWorld).distanceToSquared(e);d<(t?.distance??Number.POSITIVE_INFINITY)&&(t={distance:d,material:Array.isArray(i)?i[0]:i})}}return t?.material}boundaryLines(){return this.jobs.boundary(this.wholeScene())}numbers(){return this.numbersAsked??=this.jobs.numbers(this.wholeScene()),this.numbersAsked}stretch(e){return this.jobs.stretch(this.wholeScene(),e)}paint(e){let t=0;for(let r of this.meshes){let{geometry:n}=r,i=t+3*n.getAttribute("position").count;this.ownColors.has(n)||this.ownColors.set(n,n.attributes.color),n.setAttribute("color",he(e.slice(t,i))),t=i}}unpaint(){for(let[e,t]of this.ownColors)t===void 0?e.deleteAttribute("color"):e.setAttribute("color",t);this.ownColors.clear()}wholeScene(){return ai(this.meshes.map(e=>this.whole(e,e.matrixWorld)))}async buildTrees(){for(let e of this.meshes){let t=await this.jobs.tree(this.whole(e,void 0));this.setCut(!1),e.geometry.boundsTree=ei.deserialize(t,e.geometry),this.cutAgain()}}cutOut(e){e!==this.middles&&(this.middles=e,this.cutAgain())}setCut(e){for(let[t,{whole:r,cut:n}]of this.lists)t.geometry.setIndex(e?n:r)}whole(e,t){let r=this.lists.get(e);return ii(e.geometry,r===void 0?e.geometry.index:r.whole,t)}cutAgain(){if(this.setCut(!1),this.lists.clear(),this.middles.length===0)return;let e=this.bounds.getSize(new ue).length()+this.bounds.getCenter(new ue).length(),t=new Ue(this.middles,1e-6*e);for(let r of this.meshes){let n=r.geometry.index,i=n===null?Pn(r.geometry.getAttribute("position").count):n.array,s=vn(si(r),new Uint32Array(i),t);s!==void 0&&this.lists.set(r,{whole:n,cut:new kn(s,1)})}this.setCut(!0)}pick(e){return e.firstHitOnly=!0,e.intersectObjects(this.meshes,!1)[0]}dispose(){this.jobs.stop(),this.plain?.dispose();for(let[e,t]of this.own){e.geometry.dispose();for(let r of Array.isArray(t)?t:[t])di(r)}}};function ii(o,e,t){let r=o.getAttribute("position"),n=new Float32Array(3*r.count),i=new ue;for(let a=0;a<r.count;a+=1)i.fromBufferAttribute(r,a),t!==void 0&&i.applyMatrix4(t),i.toArray(n,3*a);let s=e===null?Pn(r.count):new Uint32Array(e.array);return{positions:n,triangles:s}}function si({geometry:o,matrixWorld:e}){let t=o.getAttribute("position"),r=new Float64Array(3*t.count),n=new ue;for(let i=0;i<t.count;i+=1)n.fromBufferAttribute(t,i).applyMatrix4(e),r.set([n.x,n.y,n.z],3*i);return r}function Pn(o){let e=new Uint32Array(o);for(let t=0;t<o;t+=1)e[t]=t;return e}function ai(o){let e=s=>s.reduce((a,d)=>a+d.length,0),t=new Float32Array(e(o.map(s=>s.positions))),r=new Uint32Array(e(o.map(s=>s.triangles))),[n,i]=[0,0];for(let s of o){t.set(s.positions,n);let a=n/3;r.set(s.triangles.map(d=>d+a),i),n+=s.positions.length,i+=s.triangles.length}return{positions:t,triangles:r}}function di(o){for(let e of Object.values(o))typeof e=="object"&&e!==null&&"isTexture"in e&&e.dispose();o.dispose()}function he(o){return new kn(o,3)}function An(o){let e=[],t=[],r=0;for(let{hole:n}of o){let{gridPositions:i=[],knownCells:s=[],chartSide:a=0}=n,d=a/64,c=new Set(s),l=h=>i.slice(3*h,3*h+3);for(let h of d>0?s:[]){let p=h%64,f=[p>0?h-1:-1,p+1<64?h+1:-1,h-64,h+64].filter(g=>c.has(g)).map(g=>ci(l(h),l(g)));f.length>0&&(e.push(...l(h)),t.push(f.reduce((g,y)=>g+y,0)/f.length/d),r=Math.max(r,1.2*d))}}return{positions:new Float32Array(e),stretch:new Float32Array(t),reach:r}}function $n({hole:o,positions:e}){let{patchFaces:t=[],patchUvs:r=[],chartSide:n=0}=o,i=e.length/3,s=new Float32Array(2*i),a=(d,c,l,h)=>{let p=0;for(let u=0;u<c;u+=1)p+=(d[c*l+u]-d[c*h+u])**2;return Math.sqrt(p)};for(let d=0;d+2<t.length&&r.length>0;d+=3)for(let c=0;c<3;c+=1){let[l,h]=[t[d+c],t[d+(c+1)%3]],p=a(r,2,l,h)*n;if(p>0)for(let u of[l,h])s[2*u]=s[2*u]+a(e,3,l,h)/p,s[2*u+1]=s[2*u+1]+1}return Float32Array.from({length:i},(d,c)=>s[2*c]/s[2*c+1])}function ci(o,e){return Math.hypot(...o.map((t,r)=>t-e[r]))}async function Dn(o){let{scene:e}=await new ui().parseAsync(o,"");e.updateMatrixWorld(!0);let t=[];return e.traverse(r=>{r instanceof Tn&&t.push({geometry:r.geometry.applyMatrix4(r.matrixWorld),image:r.material.map})}),t}var ze=class{constructor(e,{geometry:t,image:r},n){this.patch=e;this.image=r;let i=e.hole.id??0,s=e.dressing.positions.get(i)??e.positions,a=t.getAttribute("position");this.rim=(e.hole.rimPositions?.length??0)/3,this.corners=pi(a.array,s),this.firstNormals=new Float32Array(t.getAttribute("normal").array);let d=Cn(s,e.hole.patchFaces??[]);this.sides=Float32Array.from(this.corners,(c,l)=>[0,1,2].reduce((p,u)=>p+(d[3*c+u]??0)*(this.firstNormals[3*l+u]??0),0)<0?-1:1),this.ownColors=r===null?mi(e,this.corners.length):void 0,t.setAttribute("position",he(new Float32Array(3*this.corners.length))),t.setAttribute("normal",he(new Float32Array(3*this.corners.length))),this.mesh=new Tn(t,n),this.mesh.name=`hole ${i}`,this.unpaint(),this.update(e)}patch;mesh;image;corners;rim;firstNormals;ownColors;sides;get hole(){return this.patch.hole.id??0}get shown(){return this.patch}update(e){this.patch=e;let{geometry:t}=this.mesh,[r,n]=[t.getAttribute("position"),t.getAttribute("normal")],i=e.normals??Cn(e.positions,e.hole.patchFaces??[]);for(let[s,a]of this.corners.entries()){let d=this.sides[s];for(let c=0;c<3;c+=1){let l=3*s+c;r.array[l]=e.positions[3*a+c],n.array[l]=a<this.rim?this.firstNormals[l]:d*i[3*a+c]}}r.needsUpdate=!0,n.needsUpdate=!0,t.computeBoundingSphere(),t.computeBoundingBox()}heatValues(e){switch(e){case"stretch":return $n(this.patch);case"curvature":return this.numbers().curvature;case"confidence":return dn(this.patch)}}paint(e){let t=Ve(this.heatValues(e.heat),this.numbers().shade,e),r=new Float32Array(3*this.corners.length);for(let[n,i]of this.corners.entries())r.set(t.subarray(3*i,3*i+3),3*n);this.mesh.geometry.setAttribute("color",he(r))}unpaint(){let{geometry:e}=this.mesh;this.ownColors===void 0?e.deleteAttribute("color"):e.setAttribute("color",this.ownColors)}numbers(){let{positions:e,hole:t}=this.patch,r=Uint32Array.from({length:e.length/3},(n,i)=>i);return an(e,t.patchFaces??[],r)}pointOf(e){if(e.face===null||e.face===void 0||!te(this.patch))return;let t=[e.face.a,e.face.b,e.face.c].map(c=>this.corners[c]),[r,n,i]=t.map(c=>this.vertex(c)),s=hi.getBarycoord(e.point,r,n,i,new En)?.toArray();if(s===void 0)return;let a=this.patch.hole.patchUvs??[],d=[0,1].map(c=>t.reduce((l,h,p)=>l+s[p]*a[2*h+c],0));return M(this.patch,d)}dispose(){this.image?.dispose(),this.mesh.geometry.dispose()}vertex(e){return new En().fromArray(this.patch.positions,3*e)}};function pi(o,e){let t=(n,i)=>n.subarray(3*i,3*i+3).join(),r=new Map;for(let n=0;n<e.length/3;n+=1)r.set(t(e,n),n);return Uint32Array.from({length:o.length/3},(n,i)=>r.get(t(o,i))??fi(e,o.subarray(3*i,3*i+3)))}function fi(o,e){let t={vertex:0,distance:Number.POSITIVE_INFINITY};for(let r=0;r<o.length/3;r+=1){let n=[0,1,2].reduce((i,s)=>i+(o[3*r+s]-e[s])**2,0);n<t.distance&&(t={vertex:r,distance:n})}return t.vertex}function mi({hole:o,dressing:e},t){let r=Float32Array.from(o.surface?.colors??[]),n=o.id??0;if(!(e.colours.has(n)||t===0||r.length!==4*t)){if(e.textures.get(n)?.method==="flat"){let i=[0,1,2,3].map(s=>r.reduce((a,d,c)=>c%4===s?a+d:a,0)/t);return new Mn(r.map((s,a)=>i[a%4]),4)}return new Mn(r,4)}}function Cn(o,e){let t=new Float32Array(o.length),r=(n,i)=>o[3*n+i];for(let n=0;n+2<e.length;n+=3){let[i,s,a]=[e[n],e[n+1],e[n+2]],[d,c,l]=[r(s,0)-r(i,0),r(s,1)-r(i,1),r(s,2)-r(i,2)],[h,p,u]=[r(a,0)-r(i,0),r(a,1)-r(i,1),r(a,2)-r(i,2)];for(let f of[i,s,a])t[3*f]=t[3*f]+c*u-l*p,t[3*f+1]=t[3*f+1]+l*h-d*u,t[3*f+2]=t[3*f+2]+d*p-c*h}for(let n=0;n<t.length;n+=3){let i=t.subarray(n,n+3),s=Math.hypot(...i)||1;i.forEach((a,d)=>i[d]=a/s)}return t}var Ln=15770462;function On({color:o,roughness:e,metalness:t}){return new Nt({color:new li(...o),roughness:e,metalness:t,side:Sn})}function Rn(o,e){if(e!==null){let{roughness:t=.9,metalness:r=0}=o??{};return new Nt({map:e,roughness:t,metalness:r,side:Sn})}return o?.clone()??new Nt({color:12172998})}import{Box3 as yi,Group as bi,Line2 as gi,LineGeometry as vi,LineMaterial as wi,Vector3 as Ht}from"./vendor.js";var It={chosen:4,other:2},qe=class{group=new bi;lines=new Map;views=new Map;borders;constructor(e,t,r){this.borders=e.flatMap(n=>P(n)?[]:t.get(n.id??0)??[]);for(let n of e){let i=t.get(n.id??0);if(i===void 0)continue;let s=re(n.kind??""),a=r*(s.line==="dotted"?.003:.012),d=new wi({color:s.color,linewidth:It.other,dashed:s.line!=="solid",dashSize:a,gapSize:s.line==="dotted"?2*a:.7*a}),c=new vi;c.setPositions([...i.points,...i.points.subarray(0,3)]);let l=new gi(c,d);l.computeLineDistances(),this.lines.set(n.id??0,l),this.views.set(n.id??0,xi(i,n.kind)),this.group.add(l)}}choose(e){for(let[t,r]of this.lines)r.material.linewidth=e.has(t)?It.chosen:It.other}setVisible(e){this.group.visible=e}viewOf(e){return this.views.get(e)}dispose(){for(let e of this.lines.values())e.geometry.dispose(),e.material.dispose()}};function xi({points:o},e){let t=Array.from({length:o.length/3},(s,a)=>new Ht().fromArray(o,3*a)),r=new yi().setFromPoints(t),n=r.getCenter(new Ht),i=new Ht;return t.forEach((s,a)=>{let d=t[(a+1)%t.length];i.add(s.clone().sub(n).cross(d.clone().sub(n)))}),{bounds:r,front:e==="HOLE"?i.negate().normalize():i.normalize()}}var Ut={shading:"textured",tinted:!0,outlined:!0,before:!1,split:0},Ke=class{constructor(e){this.host=e;this.renderer=new Di({antialias:!0,alpha:!0}),this.renderer.setPixelRatio(Math.min(devicePixelRatio,2)),this.canvas.tabIndex=0,e.append(this.canvas),this.controls=new $i(this.camera,this.canvas),this.controls.enableDamping=!1,this.controls.addEventListener("change",()=>this.draw());let t=new Pi(16777215,1.9);t.position.set(1,1.2,.9),this.camera.add(t),this.scene.add(this.camera,new Ai(16777215,9279397,1),this.marks.group),this.resized=new ResizeObserver(()=>this.resize()),this.resized.observe(e),this.canvas.addEventListener("webglcontextrestored",()=>this.draw()),this.resize()}host;camera=new Mi(35,1,.01,100);controls;marks=new He;renderer;scene=new Si;raycaster=new Ci;resized;scan;rims;patches=[];heat;stretch;onHeat=()=>{};onError=()=>{};wanted=[];look=Ut;sphere;frameAsked=0;get canvas(){return this.renderer.domElement}get rendererName(){let e=this.renderer.getContext(),t=e.getExtension("WEBGL_debug_renderer_info");return String(e.getParameter(t?.UNMASKED_RENDERER_WEBGL??e.RENDERER))}async showScan(e,t){let r=await We.load(e.slice(0));this.clear(),this.scan=r,this.scene.add(r.root),r.setShading(this.shading),this.renewHeat();let n=r.bounds.getBoundingSphere(new Vt);this.lookAt(r.bounds,new C(.5,.5,1));let i=await r.boundaryLines();if(this.scan!==r)return;this.rims=new qe(t,Kr(t,i),n.radius||1),this.rims.setVisible(this.look.outlined),this.scene.add(this.rims.group);let s=G(t)[0]?.[1][0]?.id??0;this.lookAt(r.bounds,this.rims.viewOf(s)?.front??new C(.5,.5,1)),r.buildTrees().catch(()=>{})}chooseLoops(e){this.rims?.choose(e),this.draw()}async showPatches(e){this.wanted=e;let t=e[0]?.dressing;if(!this.showsSurfacesOf(e)){let r=t===void 0?[]:await Dn(t.glb.slice(0));if(this.wanted[0]?.dressing!==t)return;this.showsSurfacesOf(this.wanted)||(this.replacePatches(r),this.renewHeat())}this.wanted.forEach((r,n)=>{let i=this.patches[n];i!==void 0&&i.shown!==r&&(i.update(r),this.heat!==void 0&&i.paint(this.heat))}),this.draw()}showCut(e){this.scan?.cutOut(e),this.draw()}nearestOfBorder(e,t){let r=this.rims?.borders??[];return this.nearestOf(r.flatMap(Ct).map(n=>new C(...n)),{x:e,y:t},40)}stretchBetween(e,t){return qr(this.rims?.borders??[],e,t).map(n=>new C(...n))}nearestOf(e,t,r){let{left:n,top:i,width:s,height:a}=this.canvas.getBoundingClientRect();this.camera.updateMatrixWorld();let d,c=new C;for(let l of e){c.copy(l).project(this.camera);let[h,p]=[n+(c.x+1)/2*s,i+(1-c.y)/2*a],u=Math.hypot(h-t.x,p-t.y);Math.abs(c.z)<=1&&u<=Math.min(r,d?.distance??r)&&(d={point:l,distance:u})}return d?.point}setLook(e){let t=this.look;this.look={...t,...e},this.rims?.setVisible(this.look.outlined),t.shading!==this.look.shading&&this.renewHeat(),(t.shading!==this.look.shading||t.tinted!==this.look.tinted)&&this.renewMaterials(),this.draw()}renewMaterials(){this.scan?.setShading(this.shading);for(let e of this.patches)e.mesh.material.dispose(),e.mesh.material=this.materialOf(e.shown,e.image),O(this.shading)===void 0&&e.unpaint()}get shading(){let{shading:e}=this.look;return O(e)===void 0||this.heat?.heat===e?e:"shaded"}renewHeat(){let{scan:e}=this;this.showHeat().catch(t=>{this.scan===e&&this.onError(t)})}async showHeat(){let{scan:e,look:t,patches:r}=this,n=O(t.shading);if(n===void 0||e===void 0){this.heat=void 0,this.onHeat(n,void 0);return}this.onHeat(n,this.heat?.heat===n?this.heat:void 0);let[{shade:i},s]=await Promise.all([e.numbers(),this.heatOfScan(n,e)]);if(this.scan!==e||O(this.look.shading)!==n||this.patches!==r)return;let a=r.map(d=>d.heatValues(n));this.heat=bn(n,s===void 0?a:[s,...a]),e.paint(s===void 0?fn(i):Ve(s,i,this.heat));for(let d of r)d.paint(this.heat);this.renewMaterials(),this.onHeat(n,this.heat),this.draw()}async heatOfScan(e,t){if(e==="confidence")return;if(e==="curvature")return(await t.numbers()).curvature;let r=this.wanted[0]?.dressing;return(this.stretch===void 0||this.stretch.dressing!==r)&&(this.stretch={dressing:r,values:t.stretch(An(this.wanted))}),this.stretch.values}frame(e){let t=e===void 0?void 0:this.rims?.viewOf(e);this.lookAt(t?.bounds??this.scan?.bounds??new ki,t?.front??new C)}pivotAt(e){this.controls.target.copy(e),this.controls.update(),this.draw()}pick(e,t){this.aim(e,t);let r=this.look.before?[]:this.patches,n=this.raycaster.intersectObjects(r.map(({mesh:s})=>s),!1)[0],i=this.scan?.pick(this.raycaster);if(n!==void 0&&n.distance<=(i?.distance??Number.POSITIVE_INFINITY)){let s=this.patches.find(({mesh:a})=>a===n.object);return{position:n.point,cloth:s?.pointOf(n),onPatch:!0}}return i&&{position:i.point,cloth:void 0,onPatch:!1}}onScreenPlane(e,t,r){this.aim(e,t);let n=new Ei().setFromNormalAndCoplanarPoint(this.camera.getWorldDirection(new C),r);return this.raycaster.ray.intersectPlane(n,new C)??void 0}onLine(e,t,r,n){this.aim(e,t);let{origin:i,direction:s}=this.raycaster.ray,a=r.clone().sub(i),d=n.dot(s),c=(d*s.dot(a)-n.dot(a))/Math.max(1-d*d,1e-6);return r.clone().addScaledVector(n,c)}draw(){this.frameAsked===0&&(this.frameAsked=requestAnimationFrame(()=>{this.frameAsked=0,this.drawNow()}))}async picture(){this.drawNow();let e=await new Promise(t=>this.canvas.toBlob(t,"image/png"));if(e===null)throw new Error("The browser made no picture.");return e}dispose(){cancelAnimationFrame(this.frameAsked),this.clear(),this.resized.disconnect(),this.controls.dispose(),this.renderer.dispose(),this.canvas.remove()}drawNow(){this.fitDepth(),this.marks.fit(this.camera,this.host.clientHeight);let{clientWidth:e,clientHeight:t}=this.host,r=Math.round(this.look.split*e);this.renderer.setScissorTest(r>0),this.drawPart(r>0?[r,e-r]:[0,e],t,!this.look.before),r>0&&this.drawPart([0,r],t,!1)}drawPart([e,t],r,n){this.look.split>0&&this.renderer.setScissor(e,0,t,r),this.patches.forEach(({mesh:i})=>i.visible=n),this.scan?.setCut(n),this.renderer.render(this.scene,this.camera),this.patches.forEach(({mesh:i})=>i.visible=!0),this.scan?.setCut(!0)}lookAt(e,t){let{center:r,radius:n}=e.getBoundingSphere(new Vt);if(e.isEmpty()||!(n>0))return;let i=Math.min(1,this.camera.aspect),s=1.1*n/Math.sin(this.camera.fov*Math.PI/360)/i,a=t.lengthSq()>0?t.clone():this.camera.position.clone().sub(this.controls.target);this.controls.target.copy(r),this.camera.position.copy(r).addScaledVector(a.normalize(),s),this.fitDepth(),this.controls.update(),this.draw()}aim(e,t){let{left:r,top:n,width:i,height:s}=this.canvas.getBoundingClientRect(),a=new Ti((e-r)/i*2-1,1-(t-n)/s*2);this.camera.updateMatrixWorld(),this.raycaster.setFromCamera(a,this.camera)}materialOf({hole:e,dressing:t},r){let{shading:n}=this,{tinted:i}=this.look;if(i&&O(n)===void 0)return Ge(Ln,n);if(n!=="textured")return Ge(12172998,n);let s=t.colours.get(e.id??0);if(s!==void 0)return On(s);let a=this.scan?.materialNear(new C().fromArray(e.rimPositions??[0,0,0]));return Rn(a,r)}fitDepth(){if(this.scan!==void 0){this.sphere??=this.scan.bounds.getBoundingSphere(new Vt);let{center:e,radius:t}=this.sphere,r=this.camera.position.distanceTo(e);this.camera.far=r+4*t,this.camera.near=Math.max(r-4*t,this.camera.far/5e3),this.camera.updateProjectionMatrix()}}resize(){let{clientWidth:e,clientHeight:t}=this.host;e>0&&t>0&&(this.renderer.setSize(e,t),this.camera.aspect=e/t,this.camera.updateProjectionMatrix(),this.drawNow())}clear(){this.clearPatches(),this.marks.clear(),this.scan!==void 0&&(this.scene.remove(this.scan.root),this.scan.dispose()),this.rims!==void 0&&(this.scene.remove(this.rims.group),this.rims.dispose()),this.scan=void 0,this.heat=void 0,this.stretch=void 0,this.rims=void 0,this.sphere=void 0}showsSurfacesOf(e){let t=(r,n)=>this.patches[n]?.shown.dressing===r.dressing;return e.length===this.patches.length&&e.every(t)}replacePatches(e){this.clearPatches(),this.wanted.forEach((t,r)=>{let n=e[r];if(n!==void 0){let i=new ze(t,n,this.materialOf(t,n.image));this.heat!==void 0&&i.paint(this.heat),this.patches.push(i),this.scene.add(i.mesh)}})}clearPatches(){for(let e of this.patches)this.scene.remove(e.mesh),e.mesh.material.dispose(),e.dispose();this.patches=[]}};import{LitElement as Es,css as Cs,html as Z,nothing as Kn}from"./vendor.js";function V(o,e){let t=document.createElement("a");t.href=URL.createObjectURL(o),t.download=e,t.click(),setTimeout(()=>URL.revokeObjectURL(t.href),6e4)}import{css as Bi,html as Ye,nothing as S,svg as pe}from"./vendor.js";import{svg as Li}from"./vendor.js";var jt=64,Je=[[253,231,37],[53,183,121],[49,104,142],[68,1,84]];function Fn(o){let e=o.filter(t=>t!==null&&Number.isFinite(t));return e.length===0?void 0:{least:e.reduce((t,r)=>Math.min(t,r)),most:e.reduce((t,r)=>Math.max(t,r))}}function Bn(o,{least:e,most:t},r){let n=r/jt,i=Math.max(t*1e-6,Number.MIN_VALUE),s=c=>Math.log(c+i),[a,d]=[s(e),s(t)];return o.flatMap((c,l)=>{if(c===null||!Number.isFinite(c))return[];let[h,p]=[l%jt,Math.floor(l/jt)],u=Oi(d>a?(s(c)-a)/(d-a):0);return[Li`<rect x=${h*n} y=${r-(p+1)*n} width=${n} height=${n} shape-rendering="crispEdges" fill=${u} />`]})}function Oi(o){let e=Math.min(Math.max(o,0),1)*(Je.length-1),t=Math.min(Math.floor(e),Je.length-2),[r,n]=[Je[t],Je[t+1]];return`rgb(${r.map((s,a)=>Math.round(s+(n[a]-s)*(e-t))).join()})`}import{LitElement as Fi}from"./vendor.js";import{css as Ri}from"./vendor.js";var Y=Ri`
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
  summary {
    box-sizing: border-box;
    min-height: 28px;
    padding: 4px 0;
    cursor: pointer;
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
`;var m=class extends Fi{static styles=[Y];editor;changed=()=>this.requestUpdate();connectedCallback(){super.connectedCallback(),this.editor.addEventListener("change",this.changed)}disconnectedCallback(){super.disconnectedCallback(),this.editor.removeEventListener("change",this.changed)}};var U=256,Xe=64,Nn={whole:1/Xe,fine:1/(4*Xe)},Ni=new Map([["ArrowLeft",[-1,0]],["ArrowRight",[1,0]],["ArrowDown",[0,-1]],["ArrowUp",[0,1]]]),_t=class extends m{static styles=[m.styles,Bi`
      svg {
        display: block;
        width: 100%;
        max-width: 320px;
        border: 1px solid var(--line);
        border-radius: 5px;
      }
      .dot {
        cursor: grab;
        touch-action: none;
        outline: none;
      }
      .dot .focus {
        fill: transparent;
      }
      .dot:focus-visible .focus {
        stroke: #1c2026;
        stroke-width: 4;
      }
      .dot:focus-visible .ring {
        stroke: #ffffff;
      }
    `].flat();held;render(){let{draft:e,found:t,editable:r}=this.editor,i=(e===void 0||E(e)?void 0:e.hole)??t?.hole??r[0]?.hole.id,s=r.find(u=>u.hole.id===i);if(s===void 0||i===void 0)return S;let a=t!==void 0&&t.hole===i?t.found:void 0,d=s.hole.chartPng,c=this.editor.tool==="anchor"&&this.editor.map?.hole===i?this.editor.map.losses:[],l=Fn(c),h=(a?.path??[]).map(({cell:u})=>Vi(u??[])),p=this.dots(i);return Ye`
      <h2>Chart of hole ${i}</h2>
      <svg viewBox="0 0 ${U} ${U}" role="group" aria-label=${this.words(i)}>
        ${d?pe`<image href="data:image/png;base64,${d}" width=${U} height=${U} />`:S}
        ${l?Bn(c,l,U):S}
        ${h.length>1?pe`<polyline points=${h.map(u=>Qe(u).join()).join(" ")} fill="none" stroke="#0b7285" stroke-width="2" />`:S}
        ${this.gestures(i).map(u=>Hn(u,"#ffffff"))}
        ${e?Ui(e).map(u=>Hn(u,"#22b8cf")):S}
        ${a?.uv?Ii(a.uv):S} ${p.map(u=>this.anchorDot(u,s))}
      </svg>
      ${p.length>0?Ye`<p class="quiet small">
              Drag a dot to choose which place of the cloth goes to its point; the arrow keys move it, too, Enter keeps
              it.
            </p>`:S}
      ${l?Ye`<p class="small">
              The map: light where the loss is least (${b(l.least)}), dark where it is largest
              (${b(l.most)}).
            </p>`:S}
      ${a?Ye`<p class="small">
              The point belongs at u ${a.uv?.[0]?.toFixed(3)}, v ${a.uv?.[1]?.toFixed(3)}; the search went
              through ${h.length} ${h.length===1?"cell":"cells"}.
            </p>`:S}
    `}dots(e){let{draft:t,found:r,step:n}=this.editor,i=t?.kind==="anchor"&&t.hole===e?t:void 0,s=n.constraints.anchors.flatMap((d,c)=>{let l=i?.replaces===c?i:void 0,h=l?.uv??d.uv;return(d.hole===void 0||d.hole===e)&&h?.length===2?[Hi(d,{index:c,hole:e,uv:h,draft:l})]:[]}),a=i?.uv??(r?.hole===e?r.found.uv:void 0);return i===void 0||i.replaces!==void 0||a===void 0?s:[...s,{name:"New anchor",uv:a,at:d=>({...i,uv:d})}]}anchorDot(e,t){let[r,n]=Qe(e.uv),[i,s]=e.uv,a=`u ${i.toFixed(3)}, v ${s.toFixed(3)}`;return pe`
      <g
        class="dot"
        role="slider"
        tabindex="0"
        aria-label="${e.name} on the chart"
        aria-valuemin="0"
        aria-valuemax="1"
        aria-valuenow=${i.toFixed(3)}
        aria-valuetext=${a}
        @pointerdown=${d=>this.down(d,e)}
        @pointermove=${d=>this.move(d,e,t)}
        @pointerup=${this.up}
        @pointercancel=${this.cancel}
        @keydown=${d=>this.key(d,e,t)}
      >
        <circle class="focus" cx=${r} cy=${n} r="11" />
        <circle class="ring" cx=${r} cy=${n} r="6" fill="#ffd43b" stroke="#1c2026" stroke-width="2" />
      </g>
    `}down(e,{uv:t}){e.button!==0||!e.isPrimary||this.editor.work!==void 0||(e.currentTarget.setPointerCapture(e.pointerId),this.held={pointer:e.pointerId,x:e.clientX,y:e.clientY,uv:t,moved:!1})}move(e,t,r){let n=this.renderRoot.querySelector("svg")?.getBoundingClientRect();if(this.held?.pointer!==e.pointerId||n===void 0)return;this.held.moved=!0;let{x:i,y:s,uv:a}=this.held;this.put(t,[a[0]+(e.clientX-i)/n.width,a[1]-(e.clientY-s)/n.height],r)}up=e=>{let{held:t}=this;this.held=void 0,t?.pointer===e.pointerId&&t.moved&&this.editor.draft?.kind==="anchor"&&this.editor.commit()};cancel=()=>{this.held=void 0,this.editor.dropDraft()};key(e,t,r){let n=Ni.get(e.key),{draft:i,work:s}=this.editor;if(s===void 0)if(n!==void 0){e.preventDefault();let a=e.shiftKey?Nn.fine:Nn.whole;this.put(t,[t.uv[0]+a*n[0],t.uv[1]+a*n[1]],r)}else e.key==="Enter"&&i?.kind==="anchor"&&i.uv!==void 0?(e.preventDefault(),this.editor.commit()):e.key==="Escape"&&this.cancel()}put(e,t,r){if(M(r,t)===void 0)return;let n=e.at(t);this.editor.tool!=="anchor"&&this.editor.setTool("anchor"),this.editor.preview(n)}gestures(e){let t=n=>n.hole===void 0||n.hole===e;return this.editor.step.constraints.edits.filter(t).flatMap(({grab:n,twist:i,pinch:s})=>[n?.uv,i?.uv,...s?.uvs??[]]).filter(n=>n?.length===2)}words(e){let t=this.gestures(e).length+this.dots(e).length;return`The cloth around hole ${e}, laid flat, with ${t} ${t===1?"place":"places"} of constraints.`}};function Hi({position:o,hard:e=!1},{index:t,hole:r,uv:n,draft:i}){let[s=0,a=0,d=0]=o??[],c=i??{kind:"anchor",hole:r,position:[s,a,d],hard:e,replaces:t};return{name:`Anchor ${t+1}`,uv:n,at:l=>({...c,uv:l})}}function Qe([o,e]){return[o*U,(1-e)*U]}function Hn(o,e){let[t,r]=Qe(o);return pe`<circle cx=${t} cy=${r} r="5" fill=${e} stroke="#1c2026" stroke-width="1.5" />`}function Ii(o){let[e,t]=Qe(o),r=`M${e-8},${t}H${e+8}M${e},${t-8}V${t+8}`;return pe`<path d=${r} stroke="#1c2026" stroke-width="4" /><path d=${r} stroke="#ffd43b" stroke-width="2" />`}function Vi([o=0,e=0]){return[(o+.5)/Xe,(e+.5)/Xe]}function Ui(o){switch(o.kind){case"grab":case"twist":return[o.uv];case"pinch":return o.uvs;case"anchor":case"cut":case"polygon":case"border":return[]}}customElements.define("darn-chart",_t);import{html as ji}from"./vendor.js";var Wt=class extends m{render(){let{work:e}=this.editor,t=e!==void 0;return ji`
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
          <button ?disabled=${t} @click=${this.load}>Load</button>
          <button @click=${this.save}>Save as a file</button>
          <button ?disabled=${t} @click=${this.pick}>Load a file</button>
          <input type="file" accept=".json,application/json" hidden @change=${this.picked} />
        </div>
      </details>
    `}get field(){return this.renderRoot.querySelector("textarea")}copy=async()=>{let e=this.field?.value??"";try{await navigator.clipboard.writeText(e)}catch{this.field?.select(),document.execCommand("copy")}this.editor.say("Copied.")};load=()=>{this.editor.loadConstraints(this.field?.value??"")};save=()=>{let e=new Blob([this.field?.value??"",`
`],{type:"application/json"});V(e,`${J(this.editor.scan?.name)}.constraints.json`)};pick=()=>this.renderRoot.querySelector("input[type=file]")?.click();picked=async e=>{let t=e.target,r=await t.files?.[0]?.text();t.value="",r!==void 0&&await this.editor.loadConstraints(r)}};customElements.define("darn-constraints",Wt);import{css as qi,html as k,nothing as X,svg as Ki}from"./vendor.js";import{css as _i,html as Gt,nothing as Wi}from"./vendor.js";var zt=class extends m{static styles=[m.styles,_i`
      :host {
        display: block;
        margin-top: 6px;
      }
      span {
        padding: 0 4px;
      }
      button {
        min-width: 28px;
      }
      button[aria-disabled='true'],
      button[aria-disabled='true']:hover:enabled {
        border-color: var(--line);
        color: var(--quiet);
        cursor: default;
        opacity: 0.65;
      }
      p {
        margin: 4px 0 0;
      }
    `].flat();render(){let{editor:e}=this,{step:t,alternative:r,canVary:n}=e,i=xt(t.constraints.alternative,t.report),s=(a,d,c)=>Gt`
      <button
        aria-label=${d}
        ?disabled=${!n}
        aria-disabled=${c<0||c>=8}
        @click=${()=>{e.chooseFill(c)}}
      >
        ${a}
      </button>
    `;return Gt`
      <div class="row" role="group" aria-label="Fills">
        ${s("\u2039","Previous fill",r-1)}
        <span class=${n?"":"quiet"}>${D(r)}</span>
        ${s("\u203A","Next fill",r+1)}
      </div>
      ${i===void 0?Wi:Gt`<p class="small">${i}</p>`}
    `}};customElements.define("darn-fill",zt);import{css as Gi,html as qt,nothing as zi}from"./vendor.js";var Kt=class extends m{static styles=[m.styles,Gi`
      :host {
        display: block;
        margin-top: 6px;
      }
      label {
        display: block;
      }
      select:disabled {
        color: var(--quiet);
        opacity: 0.65;
      }
      p {
        margin: 4px 0 0;
      }
    `].flat();render(){let{canVary:e,texture:t,scan:r}=this.editor,n=r!==void 0&&De(r.document),i=[[void 0,kt],...z];return qt`
      <label>
        Colour of the new cloth
        <select ?disabled=${!e||!n} @change=${this.choose}>
          ${i.map(([s,a])=>qt` <option value=${s??""} .selected=${s===t}>${a}</option> `)}
        </select>
      </label>
      ${n?zi:qt`<p class="quiet small">
              This scan has neither images nor colours of vertices: the new cloth has its material.
            </p>`}
    `}choose=e=>{let{value:t}=e.target;this.dispatchEvent(new CustomEvent("darn-look",{detail:{tinted:!1},bubbles:!0,composed:!0})),this.editor.vary({texture:t===""?void 0:t})}};customElements.define("darn-texture",Kt);var Ji=new Set(["not_selected","excepted","outer_boundary","tube_end","opening"]),Jt=class extends m{static styles=[m.styles,qi`
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
      li.other {
        grid-template-columns: 1fr auto;
      }
      li .name {
        padding: 0 10px;
      }
      li button.back {
        border-color: var(--line);
        background: var(--surface);
      }
      .why {
        grid-column: 2 / -1;
        padding: 0 10px 4px;
      }
      svg {
        vertical-align: middle;
        margin-right: 6px;
      }
    `].flat();lastClicked;render(){let{scan:e,chosen:t,work:r}=this.editor,n=e?.loops??[],i=n.filter(P).map(s=>s.id??0);return k`
      <h2>Holes</h2>
      ${G(n).map(([s,a])=>this.group(s,a))}
      ${i.length===0?k`<p>This scan has no holes to fill.</p>`:X} ${this.candidates()} ${this.made()}
      ${this.doubtful()}
      <div class="row">
        <button class="main" id="mend" ?disabled=${t.size===0||r!==void 0} @click=${this.mend}>
          Mend ${t.size===1?"1 hole":`${t.size} holes`}
        </button>
        <button ?disabled=${i.length===0} @click=${()=>this.editor.choose(new Set(i))}>All</button>
        <button ?disabled=${t.size===0} @click=${()=>this.editor.choose(new Set)}>None</button>
      </div>
      <darn-fill .editor=${this.editor}></darn-fill>
      <darn-texture .editor=${this.editor}></darn-texture>
    `}doubtful(){let{skipped:e,acceptDoubtful:t}=this.editor;return!t&&!e.some(({code:n})=>n==="no_plausible_fill")?X:k`
      <label class="doubtful">
        <input type="checkbox" .checked=${t} @change=${n=>this.editor.setAcceptDoubtful(n.target.checked)} />
        Mend with doubtful cloth, too
      </label>
    `}candidates(){let e=this.editor.scan?.candidates??[];if(e.length===0)return X;let t=r=>{this.editor.setTool("border"),this.editor.preview(dt(r))};return k`
      <h3>Bites, rips and tears at the border (${e.length})</h3>
      <ul aria-label="Bites, rips and tears at the border">
        ${e.map((r,n)=>{let i=r.border?.facing!==void 0,s=i?`${b(r.length)} long`:`${b(r.depth)} deep`;return k`
            <li class="other">
              <button @click=${()=>t(r)}>${i?"Tear":"Bite or rip"} ${n+1}</button>
              <span class="quiet small">${b(r.mouth)} wide · ${s}</span>
            </li>
          `})}
      </ul>
    `}made(){let{step:e,work:t}=this.editor;return e.made.length===0?X:k`
      <h3>Cut out and borders (${e.made.length})</h3>
      <ul aria-label="Cut out and borders">
        ${e.made.map((r,n)=>k`
            <li class="other">
              <span class="name">${In(r)} ✓ mended</span>
              <button
                class="back"
                ?disabled=${t!==void 0}
                aria-label="Put back ${n+1}: ${In(r)}"
                @click=${()=>{this.editor.unmake(r)}}
              >
                Put back
              </button>
            </li>
          `)}
      </ul>
    `}group(e,t){let r=re(e),n={solid:"",dashed:"7 4",dotted:"2 4"}[r.line],i=Ki`<svg width="30" height="8" aria-hidden="true">
      <line x1="0" y1="4" x2="30" y2="4" stroke=${r.color} stroke-width="3" stroke-dasharray=${n} />
    </svg>`;return k`
      <h3>${i}${r.plural} (${t.length})</h3>
      <ul aria-label=${r.plural}>
        ${t.map(s=>this.item(s,t))}
      </ul>
    `}item(e,t){let r=e.id??0,{step:n,skipped:i,chosen:s}=this.editor,a=n.holes.includes(r),d=i.find(l=>l.id===r&&!Ji.has(l.code??"")),c=`${re(e.kind??"").singular} ${r}`;return k`
      <li>
        ${lr(e)?k`<input
                type="checkbox"
                aria-label="Choose ${c}"
                .checked=${s.has(r)}
                @click=${l=>this.toggle(l,r,t)}
              />`:k`<span></span>`}
        <button @click=${()=>this.frame(r)} aria-label="Show ${c}, length ${b(e.length)}">
          ${c}${a?" \u2713 mended":""}
        </button>
        <span class="quiet small">${b(e.length)} · ${e.vertices} vertices</span>
        ${Yi(e)} ${d?k`<span class="why quiet small">Left open: ${d.reason}.</span>`:X}
      </li>
    `}toggle(e,t,r){let n=r.map(l=>l.id??0),i=new Set(this.editor.chosen),[s,a]=[n.indexOf(this.lastClicked??t),n.indexOf(t)],d=e.shiftKey&&s>=0?n.slice(Math.min(s,a),Math.max(s,a)+1):[t],c=e.target.checked;for(let l of d)c?i.add(l):i.delete(l);this.lastClicked=t,this.editor.choose(i)}frame(e){this.dispatchEvent(new CustomEvent("darn-frame",{detail:e,bubbles:!0,composed:!0}))}mend=()=>{this.editor.mend()}};function In(o){if("border"in o){let n=o.border.facing?"Tear":"Part of the border";return o.border.auto?"All bites and rips":n}let{radius:e,loops:t,polygon:r}=o.cut;return e!==void 0?`Ball of radius ${b(e)}`:r!==void 0?`Polygon of ${r.length} corners`:`Edge of ${(t??[]).map(n=>`hole ${n}`).join(", ")}`}function Yi({confidence:o=0,evidence:e=[]}){if(e.length===0)return X;let t=[...e].sort((r,n)=>Math.abs(n.weight??0)-Math.abs(r.weight??0));return k`
    <details class="why quiet small">
      <summary>${Math.round(o*100)} % sure</summary>
      ${t.map(({reason:r})=>k`<p>${r}</p>`)}
    </details>
  `}customElements.define("darn-holes",Jt);import{LitElement as Xi,css as Qi,html as Zi}from"./vendor.js";var Ze=class{name;constructor(e){this.name=`darn key ${e.href}`}get kept(){try{return sessionStorage.getItem(this.name)??void 0}catch{return}}keep(e){try{e===void 0?sessionStorage.removeItem(this.name):sessionStorage.setItem(this.name,e)}catch{}}},Yt=class extends Xi{static styles=[Y,Qi`
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
    `];answer;ask(){return this.settle(void 0),this.field.value="",this.dialog.showModal(),new Promise(e=>this.answer=e)}render(){return Zi`
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
    `}get dialog(){return this.renderRoot.querySelector("dialog")}get field(){return this.renderRoot.querySelector("input")}submit=e=>{e.preventDefault(),this.settle(this.field.value.trim())};settle(e){let{answer:t}=this;this.answer=void 0,this.field.value="",this.dialog.close(),t?.(e)}};customElements.define("darn-key",Yt);import{css as es,html as Xt}from"./vendor.js";var ts=[["textured","Textured"],["shaded","Shaded"],["wireframe","Wireframe"],["stretch","Stretch"],["curvature","Curvature"],["confidence","Confidence"]],Qt=class extends m{static styles=[m.styles,es`
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
    `].flat();static properties={shown:{}};render(){return Xt`
      <h2>Look</h2>
      <fieldset>
        <legend class="quiet small">Surface</legend>
        <div class="row">
          ${ts.map(([e,t])=>Xt`
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
      <div>${this.check("New cloth in its own colour","tinted")}</div>
      <div>${this.check("Outlines of holes and borders","outlined")}</div>
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
    `}check(e,t){let r=n=>this.look({[t]:n.target.checked});return Xt`<label><input type="checkbox" .checked=${this.shown[t]} @change=${r} />${e}</label>`}look(e){this.dispatchEvent(new CustomEvent("darn-look",{detail:e,bubbles:!0,composed:!0}))}};customElements.define("darn-look",Qt);import{css as rs,html as Q,nothing as ns}from"./vendor.js";var Zt=class extends m{static styles=[m.styles,rs`
      .hole {
        margin-bottom: 0.75rem;
      }
      .hole p {
        margin: 0;
      }
    `].flat();render(){let{report:e}=this.editor.step,t=[...this.editor.scan?.notes??[],...e?.notes??[]];return e===void 0?t.length===0?ns:Q`<h2>Notes</h2>
            ${t.map(r=>Q`<p>${r}</p>`)}`:Q`
      <h2>Report</h2>
      <p>${Nr(e)}</p>
      ${[...new Set(t)].map(r=>Q`<p>${r}</p>`)}
      ${(e.holes??[]).map(r=>Q`<div class="hole">${Br(r).map(n=>Q`<p>${n}</p>`)}</div>`)}
      <button
        @click=${()=>V(new Blob([JSON.stringify(e,void 0,2)]),`${J(this.editor.scan?.name)}.report.json`)}
      >
        Save the report
      </button>
    `}};customElements.define("darn-report",Zt);import{css as os,html as et,nothing as is}from"./vendor.js";var er=class extends m{static styles=[m.styles,os`
      fieldset {
        margin: 0 0 0.5rem;
        padding: 0;
        border: 0;
      }
      label {
        display: flex;
        align-items: center;
        gap: 4px;
        min-height: 28px;
      }
    `].flat();static properties={look:{}};render(){return et`
      <h2>Save</h2>
      ${this.editor.step.holes.length>0?this.looks():is}
      <button @click=${()=>this.tell("darn-picture")}>Save a picture</button>
    `}looks(){return et`
      <fieldset>
        <legend class="quiet small">New cloth in the saved scan</legend>
        ${Fe.map(([e,,t])=>et`
            <label>
              <input
                type="radio"
                name="saved-look"
                .checked=${this.look===e}
                @change=${()=>this.tell("darn-saved-look",e)}
              />${t}
            </label>
          `)}
        <p class="quiet small">
          The file has both: viewers that let you choose a variant call them
          ${Fe.map(([,e],t)=>et`${t>0?" and ":""}“${e}”`)}.
        </p>
      </fieldset>
    `}tell(e,t){this.dispatchEvent(new CustomEvent(e,{detail:t,bubbles:!0,composed:!0}))}};customElements.define("darn-save",er);var R={turn:Math.PI/36,move:24,zoom:.9},ss=new Map([["ArrowLeft",[1,0]],["ArrowRight",[-1,0]],["ArrowUp",[0,1]],["ArrowDown",[0,-1]]]),as=new Map([["+",R.zoom],["=",R.zoom],["-",1/R.zoom],["_",1/R.zoom]]);function Vn(o,e){if(e.ctrlKey||e.metaKey||e.altKey)return!1;let[t,r]=[ss.get(e.key),as.get(e.key)];return t!==void 0&&e.shiftKey?o.pan(R.move*t[0],R.move*t[1]):t!==void 0?(o.rotateLeft(R.turn*t[0]),o.rotateUp(R.turn*t[1])):r!==void 0&&o.dollyIn(r),t!==void 0||r!==void 0}import{Vector3 as F}from"./vendor.js";var ds=64;function Un(o,e){let{draft:t}=o,{cloth:r,border:n,disk:i}=e;if(t!==void 0&&E(t))return cs(t,e);if(n!==void 0)return{handles:[n]};let s=t?.hole??r?.hole??i?.point.hole,a=o.step.patches.find(l=>l.hole.id===s),d=o.patches.find(l=>l.hole.id===s);if(a===void 0||d===void 0)return{};let c=o.reportOf(d.hole.id??0)?.grid?.spacingMean??0;return t===void 0?r?{handles:[fe(d,r)]}:i?jn(i,d,c):{}:ls(t,a,d,c)}function jn({point:o,radius:e},t,r){let n=fe(t,o),i=nn(n,new F(...W(t,o)),e*ds*r);return{handles:[n],ring:i,disk:{center:n,ring:i}}}function cs(o,{stretch:e}){switch(o.kind){case"cut":{let t=new F(...o.center);return{handles:[t],ball:{center:t,radius:o.radius}}}case"polygon":{let t=o.corners.map(r=>new F(...r));return{handles:t,stretches:[t.length<3?t:[...t,...t.slice(0,1)]]}}case"border":{let t=N(o).map(s=>new F(...s)),r=br(o).map(s=>s.map(a=>new F(...a))),{facing:n}=o,i=n===void 0?[e(o)]:[e(o,n),e(n,o)];return{handles:t,stretches:i,dashes:r}}}}function ls(o,e,t,r){switch(o.kind){case"grab":{let n=M(e,o.uv),i=n&&fe(e,n).add(new F(...o.offset));return n&&i?{handles:[i],tethers:[[fe(t,n),i]]}:{}}case"twist":{let n=M(t,o.uv);return n?jn({point:n,radius:o.radius},t,r):{}}case"pinch":{let i=o.uvs.map(d=>M(t,d)).filter(d=>d!==void 0).map(d=>fe(t,d)),[s,a]=i;return{handles:i,tethers:s&&a?[[s,a]]:[]}}case"anchor":return{handles:[new F(...o.position)]}}}function fe(o,e){return new F(..._(o,e))}import{Vector3 as B}from"./vendor.js";var us=4,hs=16,ps=Math.PI/200,tt={step:1.1,least:.02,most:.5},_n=new Map([["x",new B(1,0,0)],["y",new B(0,1,0)],["z",new B(0,0,1)]]),Wn={cloth:void 0,onPatch:!1},rt=class extends PointerEvent{constructor(e){super("pointerdown",e)}},nt=class{constructor(e,t){this.viewer=e;this.editor=t;let{signal:r}=this.listening,n={capture:!0,signal:r},{canvas:i}=e;i.addEventListener("pointerdown",s=>this.down(s),n),i.addEventListener("pointermove",s=>this.move(s),n),i.addEventListener("pointerup",s=>this.up(s),n),i.addEventListener("pointercancel",()=>this.cancel(),n),i.addEventListener("pointerleave",()=>this.hover(void 0),{signal:r}),i.addEventListener("wheel",s=>this.wheel(s),{...n,passive:!1}),addEventListener("keydown",s=>this.key(s,!0),{signal:r}),addEventListener("keyup",s=>this.key(s,!1),{signal:r})}viewer;editor;hold;firstOfPinch;heldAxis;radius=.125;firstOfBorder;hovered;onMarks=()=>{};listening=new AbortController;get waitingPoint(){return this.editor.tool==="pinch"?this.firstOfPinch:void 0}get waitingEnd(){return this.editor.tool==="border"?this.firstOfBorder:void 0}get disk(){let{tool:e,work:t}=this.editor,r=this.hold===void 0?this.hovered:this.hold.cloth?.point;return e==="twist"&&t===void 0&&r?{point:r,radius:this.radius}:void 0}cancel(){this.hold=void 0,this.firstOfPinch=void 0,this.firstOfBorder=void 0,this.editor.dropDraft()}dispose(){this.listening.abort()}down(e){let{tool:t,work:r}=this.editor;if(e instanceof rt)return;if(this.hold!==void 0){this.joined(this.hold,e);return}if(t==="look"||r!==void 0||e.button!==0||!e.isPrimary)return;if(t==="border"){this.borderDown(e);return}let{draft:n}=this.editor;if(n?.kind==="polygon"&&this.takeHandle(e,n.corners))return;let i=this.viewer.pick(e.clientX,e.clientY),s=this.held(i?.cloth);if(t==="cut"||t==="polygon"){this.cutDown(e,i);return}i===void 0||s===void 0&&(t!=="anchor"||this.editor.editable.length===0)||(this.take(e,{hit:i,cloth:s}),this.onMarks())}hover(e){e!==this.hovered&&(this.hovered=e,this.onMarks())}take(e,{hit:t,cloth:r,part:n}){e.stopImmediatePropagation(),this.viewer.canvas.focus(),this.viewer.canvas.setPointerCapture(e.pointerId);let{pointerId:i,clientX:s,clientY:a}=e;this.hold={pointer:i,x:s,y:a,hit:t,cloth:r,part:n,moved:!1,before:this.editor.draft,last:e}}joined(e,t){if(t.pointerType!=="touch"||e.last.pointerType!=="touch"){t.stopImmediatePropagation();return}this.hold=void 0,e.before===void 0?this.editor.dropDraft():this.editor.preview(e.before),this.viewer.canvas.dispatchEvent(new rt(e.last))}takeHandle(e,t){let r=t.map(i=>new B(...i)),n=this.viewer.nearestOf(r,{x:e.clientX,y:e.clientY},hs);return n===void 0?!1:(this.take(e,{hit:{position:n,...Wn},cloth:void 0,part:r.indexOf(n)}),!0)}cutDown(e,t){if(t===void 0)return;if(t.onPatch){e.stopImmediatePropagation(),this.editor.say("Only cloth of the scan itself can be cut out.");return}if(this.editor.tool==="polygon"){this.cornerDown(e,t);return}this.take(e,{hit:t,cloth:void 0});let{radius:r}=this.cutDraft();this.editor.preview({kind:"cut",center:t.position.toArray(),radius:r})}cornerDown(e,t){this.take(e,{hit:t,cloth:void 0,part:this.polygonDraft().corners.length});let r=this.polygonDraft();this.editor.preview({...r,corners:[...r.corners,t.position.toArray()]})}polygonDraft(){let{draft:e}=this.editor;return e?.kind==="polygon"?e:{kind:"polygon",corners:[]}}cutDraft(){let{draft:e,scan:t}=this.editor,r={loops:t?.loops??[],candidates:[]};return e?.kind==="cut"?e:be("cut",r)}borderDown(e){let{draft:t}=this.editor;if(t?.kind==="border"){this.takeHandle(e,N(t));return}let r=this.viewer.nearestOfBorder(e.clientX,e.clientY);r!==void 0&&this.take(e,{hit:{position:r,...Wn},cloth:void 0})}bordered({hit:e,moved:t}){let{draft:r}=this.editor;if(t||r?.kind==="border")return;let n=this.firstOfBorder;if(n===void 0){this.firstOfBorder=e.position,this.editor.say("Border: click where the stretch ends.");return}this.firstOfBorder=void 0,this.editor.say("Border: drag its ends, or mend it."),this.editor.preview({kind:"border",from:n.toArray(),to:e.position.toArray(),along:[]})}movedHandle({hit:e,part:t=0},{clientX:r,clientY:n}){let{draft:i}=this.editor;if(i?.kind!=="border")return;let a=t<fr(i)?this.viewer.nearestOfBorder(r,n):this.viewer.onScreenPlane(r,n,e.position);return a&&we(i,t,a.toArray())}movedCorner({part:e=0},{clientX:t,clientY:r}){let{draft:n}=this.editor,i=this.viewer.pick(t,r),s=i!==void 0&&!i.onPatch;return n?.kind==="polygon"&&s?ge(n,e,i.position.toArray()):void 0}move(e){let{hold:t}=this;if(t===void 0&&e.buttons===0){let n=this.editor.tool==="twist";this.hover(n?this.viewer.pick(e.clientX,e.clientY)?.cloth:void 0)}if(t===void 0||e.pointerId!==t.pointer)return;e.stopImmediatePropagation(),t.last=e,t.moved||=Math.hypot(e.clientX-t.x,e.clientY-t.y)>us;let r=t.moved?this.dragged(t,e):void 0;r!==void 0&&this.editor.preview(r)}up(e){let{hold:t}=this;if(t===void 0||e.pointerId!==t.pointer)return;e.stopImmediatePropagation(),this.hold=void 0,this.hover(e.pointerType==="touch"?void 0:t.cloth?.point);let{tool:r}=this.editor;r==="pinch"?this.pinched(t):r==="border"?this.bordered(t):r==="cut"?this.editor.say("Cut out: change the ball, or cut it out and mend."):r==="polygon"?this.editor.say(fs(this.editor.draft)):r==="anchor"&&!t.moved?(this.editor.preview(this.anchorAt(t,t.hit.position)),this.editor.commit()):t.moved&&this.editor.draft!==void 0&&this.editor.commit()}dragged(e,t){let{cloth:r}=e;switch(this.editor.tool){case"grab":return r&&this.grabbed(r,t);case"twist":return r&&this.twisted(r,t.clientX-e.x);case"anchor":{let n=this.viewer.onScreenPlane(t.clientX,t.clientY,e.hit.position);return n&&this.anchorAt(e,n)}case"cut":{let i=this.viewer.onScreenPlane(t.clientX,t.clientY,e.hit.position)?.distanceTo(e.hit.position)??0;return i>0?{kind:"cut",center:e.hit.position.toArray(),radius:i}:void 0}case"polygon":return this.movedCorner(e,t);case"border":return this.movedHandle(e,t);default:return}}grabbed({point:e,position:t,normal:r},n){let{clientX:i,clientY:s}=n,a=n.shiftKey?r:_n.get(this.heldAxis??""),d=a?this.viewer.onLine(i,s,t,a):this.viewer.onScreenPlane(i,s,t),{hole:c,uv:l}=e;return d&&{kind:"grab",hole:c,uv:l,offset:d.sub(t).toArray()}}twisted({point:e,normal:t},r){let n=t.clone();n.dot(this.viewer.camera.getWorldDirection(new B))>0&&n.negate();let{hole:i,uv:s}=e;return{kind:"twist",hole:i,uv:s,radius:this.radius,axis:n.toArray(),angle:-r*ps}}anchorAt({cloth:e},t){let r=t.toArray(),n=dr(this.editor.editable,r)?.hole.id??0,{draft:i}=this.editor,s=i?.kind==="anchor"&&i.hard;return{kind:"anchor",hole:e?.point.hole??n,position:r,hard:s}}pinched({cloth:e}){let t=this.firstOfPinch;if(e===void 0)return;if(t===void 0||t.hole!==e.point.hole){this.firstOfPinch=e.point,this.editor.say("Pinch: click the second point.");return}this.firstOfPinch=void 0;let r=[t.uv,e.point.uv];this.editor.say("Pinch: choose how much, then apply."),this.editor.preview({kind:"pinch",hole:t.hole,uvs:r,amount:.5})}wheel(e){let{draft:t}=this.editor;if(t?.kind==="cut"){let i=this.viewer.pick(e.clientX,e.clientY);i!==void 0&&i.position.distanceTo(new B(...t.center))<=t.radius&&(e.preventDefault(),e.stopImmediatePropagation(),this.editor.preview({...t,radius:t.radius*tt.step**-Math.sign(e.deltaY)}));return}let r=this.editor.tool==="twist"?this.viewer.pick(e.clientX,e.clientY)?.cloth:void 0;if(r===void 0)return;this.hovered=r,e.preventDefault(),e.stopImmediatePropagation();let n=this.radius*tt.step**-Math.sign(e.deltaY);this.radius=Math.min(Math.max(n,tt.least),tt.most),t?.kind==="twist"?this.editor.preview({...t,radius:this.radius}):this.editor.say(`Twist: radius ${this.radius.toFixed(3)} of the chart.`)}key(e,t){let r=e.key.toLowerCase();t&&r==="escape"?this.cancel():_n.has(r)&&(t?this.hold!==void 0:r===this.heldAxis)&&(this.heldAxis=t?r:void 0)}held(e){let t=this.editor.step.patches.find(({hole:r})=>r.id===e?.hole);return e&&t&&{point:e,position:new B(..._(t,e)),normal:new B(...W(t,e))}}};function fs(o){let e=o?.kind==="polygon"?o.corners.length:0,t=e<3?"click the next one":"click another, or cut it out and mend";return`Cut out: ${e} ${e===1?"corner":"corners"}; ${t}.`}import{css as gs,html as vs}from"./vendor.js";import{css as ms,html as j,nothing as tr,unsafeCSS as ot}from"./vendor.js";var zn=ms`
  .legend {
    position: absolute;
    top: 12px;
    left: 12px;
    width: 21rem;
    max-width: calc(100% - 24px);
    box-sizing: border-box;
    padding: 8px 10px;
    border: 1px solid var(--line);
    border-radius: 6px;
    background: var(--surface);
    font-size: 12px;
    pointer-events: none;
  }
  .legend p {
    margin: 4px 0 0;
  }
  .bar {
    height: 14px;
    margin-top: 4px;
    border: 1px solid var(--line);
    border-radius: 3px;
    background: ${ot(Ft("curvature"))};
  }
  .bar.confidence {
    background: ${ot(Ft("confidence"))};
  }
  .ends {
    display: flex;
    justify-content: space-between;
    gap: 8px;
  }
  .ends span:nth-child(2) {
    text-align: center;
  }
  .ends span:last-child {
    text-align: right;
  }
  .patch {
    display: inline-block;
    width: 12px;
    height: 12px;
    border-radius: 3px;
    vertical-align: -1px;
    background: ${ot(mn)};
  }
  .patch.own {
    background: ${ot(yn)};
  }
`,Gn="From blue over white to orange",ys={stretch:{title:"Stretch",about:"Lengths of the cloth, compared with the same cloth laid flat.",unknown:"Grey: not laid flat: away from the mended holes.",bar:Gn,ends:o=>{let e=`${b(o*100)} %`;return[`${Number(((1-1/(1+o))*100).toPrecision(2))} % shorter`,"as flat",`${e} longer`]}},curvature:{title:"Curvature",about:"Whether the cloth bends in two directions at once. Cloth that is only folded stays white.",unknown:"Grey: not known.",bar:Gn,unit:"In one over the scan's unit squared.",ends:o=>[`saddle, \u2212${b(o)}`,"flat or folded, 0",`dome, ${b(o)}`]},confidence:{title:"Confidence",about:"How far new cloth may be off: nine of ten vertices lie within 1.6 times this of the cloth that was there. That is of the cloth before anchors and gestures.",unknown:"Dark grey: new cloth of which it is not known.",bar:"From light yellow over orange to dark brown",own:"Light grey: the scan's own cloth.",unit:"In the scan's unit.",ends:o=>["certain, 0",`uncertain, ${b(o)}`]}},bs="Nothing is known: no hole is mended yet, or none that is has a chart and was filled with weights that were calibrated.";function qn(o,e){if(o===void 0)return tr;let{title:t,about:r,unknown:n,bar:i,own:s,unit:a,ends:d}=ys[o];if(e===void 0)return j`<div class="legend" role="status"><strong>${t}</strong> is computed …</div>`;let c=Number.isNaN(e.most);return j`
    <div class="legend" role="group" aria-label="Legend: ${t}">
      <strong>${t}</strong>
      ${c?j`<p>${bs}</p>`:j`<div class="bar ${o}" role="img" aria-label=${i}></div>
              <div class="ends">${d(e.most).map(l=>j`<span>${l}</span>`)}</div>
              <p>${r}</p>`}
      <p><span class="patch"></span> ${n}</p>
      ${s===void 0?tr:j`<p><span class="patch own"></span> ${s}</p>`}
      ${a===void 0||c?tr:j`<p class="quiet">${a}</p>`}
    </div>
  `}var rr=class extends m{static styles=[m.styles,zn,gs`
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
    `].flat();viewer;gestures;heat;scale;opened=()=>{this.show()};connectedCallback(){super.connectedCallback(),this.editor.addEventListener("opened",this.opened)}disconnectedCallback(){super.disconnectedCallback(),this.editor.removeEventListener("opened",this.opened),this.gestures?.dispose(),this.viewer?.dispose(),this.viewer=void 0}render(){return vs`<div id="host"></div>
      ${qn(this.heat,this.scale)}`}firstUpdated(){let e=this.renderRoot.querySelector("#host");if(e===null)return;try{this.viewer=new Ke(e),this.gestures=new nt(this.viewer,this.editor),this.gestures.onMarks=()=>this.requestUpdate()}catch(r){this.editor.report(new Error(`This browser draws no 3-D pictures (WebGL 2): ${String(r)}`));return}this.viewer.onError=r=>this.editor.report(r),this.viewer.onHeat=(r,n)=>{this.heat=r,this.scale=n,this.requestUpdate()};let{canvas:t}=this.viewer;t.setAttribute("role","img"),t.setAttribute("aria-label","The scan. Drag or arrow keys to turn it; two fingers, the right button or Shift and arrow keys to move it; the wheel, plus or minus to zoom; F to see all."),t.addEventListener("keydown",r=>{this.viewer!==void 0&&Vn(this.viewer.controls,r)&&r.preventDefault()}),t.addEventListener("dblclick",r=>{let n=this.viewer?.pick(r.clientX,r.clientY);n!==void 0&&this.viewer?.pivotAt(n.position)})}updated(){this.viewer?.chooseLoops(this.editor.chosen),this.viewer?.showPatches(this.editor.patches),this.viewer?.showCut(this.editor.step.cutFaces),this.viewer?.marks.show(Un(this.editor,{cloth:this.gestures?.waitingPoint,border:this.gestures?.waitingEnd,disk:this.gestures?.disk,stretch:(e,t)=>this.viewer?.stretchBetween(e,t)??[]}))}async show(){let{scan:e}=this.editor;if(e!==void 0)try{await this.viewer?.showScan(e.bytes,e.loops),this.requestUpdate()}catch(t){this.editor.report(new Error(`The scan was read by the service, but cannot be drawn: ${String(t)}`))}}};customElements.define("darn-stage",rr);import{css as ws,html as v,nothing as T}from"./vendor.js";var it=[{tool:"look",name:"Look",key:"L",help:"Drag to turn the scan, right button or two fingers to move it, wheel to zoom. With the picture in focus, the arrow keys turn it, with Shift they move it, + and - zoom."},{tool:"grab",name:$.grab,key:"G",help:"Drag new cloth in the plane of the screen; hold Shift to pull it along its normal, or X, Y or Z along an axis."},{tool:"twist",name:$.twist,key:"T",help:"Drag to the left or right on new cloth to turn a disk of it; the wheel changes its size."},{tool:"pinch",name:$.pinch,key:"P",help:"Click two points of new cloth, then choose how far to draw them together."},{tool:"anchor",name:$.anchor,key:"A",help:"Drag from the cloth to where it should be, or type the point; the service finds which place of the cloth belongs there. That place is a dot on the chart, which can be dragged."},{tool:"cut",name:$.cut,key:"C",help:"For stained, torn or badly scanned cloth: press on its middle and drag to its edge. What the ball touches is cut out, and new cloth is put in. The wheel changes its size."},{tool:"border",name:$.border,key:"E",help:"For a bite or a rip at the edge of the cloth: click where it begins and where it ends. New cloth goes up to the dashed line; add points where the new hem should go. Where the cloth is torn in two, add the edge that faces it: the two are joined."}],xs="For damaged cloth of any outline: click its corners one after another. A corner can be dragged, and Backspace takes the last one back. What lies under the polygon is cut out, and new cloth is put in.",ks=[["cut","Ball"],["polygon","Polygon"]];function or(o){return!["look","cut","polygon","border"].includes(o)}var Ps={grab:"Apply",twist:"Apply",pinch:"Apply",anchor:"Find its place",cut:"Cut out and mend",polygon:"Cut out and mend",border:"Mend up to the new hem"};function As(o){return o.kind==="anchor"&&o.uv!==void 0?"Apply":Ps[o.kind]}var $s=["x","y","z"],nr=class extends m{static styles=[m.styles,ws`
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
      fieldset {
        display: flex;
        gap: 12px;
        margin: 0;
        padding: 0;
        border: 0;
      }
      .check {
        display: flex;
        align-items: center;
        gap: 4px;
      }
    `].flat();render(){let{tool:e,step:t,editable:r}=this.editor,n=e==="polygon"?"cut":e,i=e==="polygon"?xs:it.find(s=>s.tool===e)?.help??"";return v`
      <h2>Tools</h2>
      <div class="row tools" role="group" aria-label="Tools">
        ${it.map(s=>v`
            <button
              aria-pressed=${s.tool===n}
              aria-keyshortcuts=${s.key}
              title="${s.name} (${s.key})"
              ?disabled=${r.length===0&&or(s.tool)}
              @click=${()=>this.editor.setTool(s.tool)}
            >
              ${s.name}
            </button>
          `)}
      </div>
      <p class="quiet small">${i}</p>
      ${r.length>0||e!=="look"?T:v`<p class="quiet small">${Ms(t.patches.length)}</p>`}
      ${e==="look"?T:this.form(this.draftOf(e))}
    `}draftOf(e){let{draft:t,editable:r,scan:n}=this.editor,[i]=r;return t?.kind===e?t:e==="cut"||e==="polygon"||e==="border"?n&&be(e,n):i&&at(e,i)}form(e){if(e===void 0)return T;let{work:t}=this.editor,r=t!==void 0;return v`
      <form @submit=${n=>this.apply(n,e)}>
        ${E(e)?this.shapes(e):this.holeField(e)} ${this.fields(e)}
        <div class="row wide">
          <button class="main" ?disabled=${r||!ur(e)}>${As(e)}</button>
          <button type="button" ?disabled=${this.editor.draft===void 0} @click=${()=>this.editor.dropDraft()}>
            Cancel
          </button>
          ${e.kind==="anchor"?this.mapButton(e):T}
        </div>
      </form>
    `}mapButton(e){let{work:t,map:r}=this.editor;return r?.isComing?v`
        <button type="button" @click=${()=>this.editor.stopMap()}>Stop the map</button>
        <progress aria-label="The map" max="1" .value=${r.share}></progress>
      `:v`<button type="button" ?disabled=${t!==void 0} @click=${()=>{this.editor.drawMap(e)}}>Draw the map</button>`}holeField(e){let t=this.editor.editable;return t.length<2?T:v`
      <label class="wide">
        Hole
        <select @change=${n=>{let i=Number(n.target.value),s=t.find(({hole:a})=>a.id===i);s!==void 0&&this.preview(e.kind==="anchor"?{...e,hole:i}:at(e.kind,s))}}>
          ${t.map(({hole:n})=>v`<option value=${n.id} ?selected=${n.id===e.hole}>${n.id}</option>`)}
        </select>
      </label>
    `}fields(e){switch(e.kind){case"grab":return this.grabFields(e);case"twist":return this.twistFields(e);case"pinch":return this.pinchFields(e);case"anchor":return this.anchorFields(e);case"cut":return this.cutFields(e);case"polygon":return this.polygonFields(e);case"border":return this.borderFields(e)}}grabFields(e){return v`
      ${this.uvFields(e.uv,"",t=>({...e,uv:t}))}
      <span></span>
      ${this.vectorFields("Move",e.offset,t=>({...e,offset:t}))}
    `}twistFields(e){let t=e.angle*180/Math.PI;return v`
      ${this.uvFields(e.uv,"",r=>({...e,uv:r}))}
      ${this.number("Radius",e.radius,r=>({...e,radius:r}))}
      ${this.vectorFields("Axis",e.axis,r=>({...e,axis:r}))}
      ${this.number("Angle in degrees",t,r=>({...e,angle:r*Math.PI/180}))}
    `}pinchFields(e){let[t,r]=e.uvs,n=i=>{this.preview({...e,amount:Number(i.target.value)})};return v`
      ${this.uvFields(t,"First ",i=>({...e,uvs:[i,r]}))}
      <span></span>
      ${this.uvFields(r,"Second ",i=>({...e,uvs:[t,i]}))}
      <span></span>
      <label class="wide">
        Share of their distance to take away: ${Math.round(e.amount*100)} %
        <input type="range" min="0" max="1" step="0.01" .value=${String(e.amount)} @input=${n} />
      </label>
    `}anchorFields(e){let t=r=>{this.preview({...e,hard:r.target.checked})};return v`
      ${this.vectorFields("Point",e.position,r=>({...e,position:r}))} ${this.placeFields(e)}
      <label class="wide check">
        <input type="checkbox" .checked=${e.hard} @change=${t} />
        Hard: refuse it where the cloth cannot reach it
      </label>
    `}placeFields(e){let t=this.editor.editable.find(({hole:n})=>n.id===e.hole),r=e.uv??(t===void 0?void 0:me(t))??[.5,.5];return["u","v"].map((n,i)=>this.number(n,e.uv?.[i],s=>({...e,uv:r.with(i,s)})))}cutFields(e){return v`
      ${this.vectorFields("Centre",e.center,t=>({...e,center:t}))}
      ${this.number("Radius",e.radius,t=>({...e,radius:t}))} ${this.cutEdges()}
    `}polygonFields(e){let{corners:t}=e,{scan:r}=this.editor,n=()=>this.preview(pr(e,r?.loops??[])),i=()=>this.preview(ve(e));return v`
      ${t.map((s,a)=>this.vectorFields(`Corner ${a+1}`,s,d=>ge(e,a,d)))}
      <div class="row wide">
        <button type="button" @click=${n}>Add a corner</button>
        <button type="button" ?disabled=${t.length===0} @click=${i}>Take the last corner back</button>
      </div>
      ${t.length<2?T:this.number("Depth",ct(e),s=>({...e,depth:s}))}
      ${this.cutEdges()}
    `}shapes({kind:e}){return e==="border"?T:v`
      <fieldset class="wide">
        <legend class="quiet small">Shape</legend>
        ${ks.map(([t,r])=>v`
            <label class="check">
              <input
                type="radio"
                name="shape"
                .checked=${t===e}
                @change=${()=>this.editor.setTool(t)}
              />${r}
            </label>
          `)}
      </fieldset>
    `}cutEdges(){let{scan:e,chosen:t,work:r}=this.editor,i=(e?.loops??[]).filter(P).map(a=>a.id??0).filter(a=>t.has(a));return i.length===0?T:v`
      <div class="row wide">
        <button type="button" ?disabled=${r!==void 0} @click=${()=>{this.editor.make("Cut edges back",{cut:{loops:i}})}}>Cut the edges of chosen holes back</button>
      </div>
    `}borderFields(e){let{from:t,to:r,along:n,facing:i}=e,s=[0,1,2].map(p=>(t[p]+r[p])/2),a=()=>this.preview({...e,along:[...n,n.at(-1)??s]}),d=p=>this.preview({...e,along:n.filter((u,f)=>f!==p)}),l=["From","To",...i?["Facing from","Facing to"]:n.map((p,u)=>`Hem ${u+1}`)],h=N(e).map((p,u)=>this.vectorFields(l[u],p,f=>we(e,u,f)));return i!==void 0?v`
        ${h}
        <div class="row wide">
          <button type="button" @click=${()=>this.preview(yr(e))}>Without the facing edge</button>
        </div>
      `:v`
      ${h}
      <div class="row wide">
        <button type="button" @click=${()=>this.preview(mr(e))}>Join with a facing edge</button>
        <button type="button" @click=${a}>Add a point of the hem</button>
        ${n.length>0?v`<button type="button" @click=${()=>d(n.length-1)}>Remove the last point</button>`:T}
      </div>
    `}uvFields([e,t],r,n){return[this.number(`${r}u`,e,i=>n([i,t])),this.number(`${r}v`,t,i=>n([e,i]))]}vectorFields(e,t,r){return $s.map((n,i)=>this.number(`${e} ${n}`,t[i],s=>r(t.with(i,s))))}number(e,t,r){let n=i=>{let s=i.target.valueAsNumber;Number.isFinite(s)&&this.preview(r(s))};return v`
      <label>
        ${e}
        <input
          type="number"
          step="any"
          placeholder="found"
          .value=${t===void 0?"":String(Number(t.toPrecision(6)))}
          @change=${n}
        />
      </label>
    `}preview(e){this.editor.preview(e)}apply(e,t){e.preventDefault(),this.editor.preview(t),this.editor.commit()}};customElements.define("darn-tools",nr);function Ms(o){return o===0?"Mend a hole to edit its new cloth.":"The cloth around what is filled cannot be laid flat, so its new cloth takes no gestures."}var ir=class extends Es{static styles=[Y,Cs`
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
    `];static properties={src:{},key:{},baseUrl:{attribute:"base-url"}};dragging=!1;shown=Ut;savedLook="blended";made;constructor(){super(),this.addEventListener("dragover",this.dragOver),this.addEventListener("dragleave",this.dragLeave),this.addEventListener("drop",this.drop)}get editor(){return this.made??=this.makeEditor(),this.made}makeEditor(){let e=new Ze(this.base),t=async()=>{await this.updateComplete;let i=await this.keyDialog?.ask();return e.keep(i),i},r=new de(this.base,{key:this.key??e.kept,askForKey:t}),n=new Re(r);n.addEventListener("change",()=>this.requestUpdate()),n.addEventListener("opened",()=>this.emit("opened",{name:n.scan?.name}));for(let i of["mended","edited"])n.addEventListener(i,()=>{let{report:s,constraints:a}=n.step;this.emit(i,{report:s,constraints:a})});return n}get base(){return new URL(this.baseUrl??new URL("..",import.meta.url),document.baseURI)}connectedCallback(){super.connectedCallback(),addEventListener("keydown",this.keyDown),addEventListener("keyup",this.keyUp)}disconnectedCallback(){super.disconnectedCallback(),removeEventListener("keydown",this.keyDown),removeEventListener("keyup",this.keyUp)}willUpdate(e){let{src:t}=this;if(!(!e.has("src")||t===void 0))try{this.editor.openAddress(new URL(t,document.baseURI))}catch{this.editor.report(new Error(`${t} is not an address.`))}}emit(e,t){return this.dispatchEvent(new CustomEvent(e,{detail:t,bubbles:!0,composed:!0,cancelable:!0}))}render(){let{editor:e}=this,{scan:t,work:r}=e;return Z`
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
        ${t===void 0&&r===void 0?this.welcome():Kn} ${this.notices()}
      </main>
      <aside
        @darn-frame=${this.frame}
        @darn-look=${this.look}
        @darn-saved-look=${this.chooseSavedLook}
        @darn-picture=${this.savePicture}
      >
        ${t===void 0?Z`<p class="quiet">The holes of the scan will be listed here.</p>`:Z`
                <darn-holes .editor=${e}></darn-holes>
                <darn-tools .editor=${e}></darn-tools>
                <darn-chart .editor=${e}></darn-chart>
                <darn-look .editor=${e} .shown=${this.shown}></darn-look>
                <darn-save .editor=${e} .look=${this.savedLook}></darn-save>
                <darn-report .editor=${e}></darn-report>
                <darn-constraints .editor=${e}></darn-constraints>
              `}
      </aside>
      <darn-key></darn-key>
      <div class="hidden" role="status" aria-live="polite">${e.work?.label??e.message}</div>
    `}welcome(){return Z`
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
    `}notices(){let{work:e,problem:t}=this.editor;return t!==void 0?Z`
        <div class="notice problem" role="alert">
          <p>${t}</p>
          <button @click=${()=>this.editor.clearProblem()}>Close</button>
        </div>
      `:e===void 0?Kn:Z`
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
    `}get keyDialog(){return this.renderRoot.querySelector("darn-key")}get stage(){return this.renderRoot.querySelector("darn-stage")}pick=()=>this.renderRoot.querySelector("#file")?.click();picked=e=>{let t=e.target;this.openFiles([...t.files??[]]),t.value=""};async openFiles(e){try{let t=await Vr(e);t!==void 0&&await this.editor.open(t.file,t.name)}catch(t){this.editor.report(t)}}openExample=()=>{this.editor.openAddress(new URL("editor/scarf_hole.glb",this.base))};save=async()=>{let e=await this.editor.result();if(e!==void 0){let t=await Gr(e,this.savedLook),n=(this.editor.scan?.name??"scan.glb").replace(/(\.[a-z]+)?$/i,i=>`.mended${i||".glb"}`);this.emit("saved",{file:t,name:n})&&V(t,n)}};chooseSavedLook=({detail:e})=>{this.savedLook=e,this.requestUpdate()};savePicture=async()=>{let e=await this.stage?.viewer?.picture();e!==void 0&&(V(e,`${J(this.editor.scan?.name)}.png`),this.editor.say("The picture is saved."))};dragOver=e=>{e.preventDefault(),this.setDragging(!0)};dragLeave=()=>this.setDragging(!1);drop=e=>{e.preventDefault(),this.setDragging(!1),this.openFiles([...e.dataTransfer?.files??[]])};setDragging(e){this.dragging=e,this.requestUpdate()}frame=e=>this.stage?.viewer?.frame(e.detail);look=e=>{this.shown={...this.shown,...e.detail},this.stage?.viewer?.setLook(e.detail),this.requestUpdate()};keyDown=e=>{if(!this.isMeant(e))return;let t=e.key.toLowerCase();if((e.ctrlKey||e.metaKey)&&(t==="z"||t==="y")&&!Jn(e)){e.preventDefault(),t==="y"||e.shiftKey?this.editor.redo():this.editor.undo();return}if(e.ctrlKey||e.metaKey||e.altKey||Jn(e))return;let r=it.find(i=>i.key.toLowerCase()===t)?.tool,n=this.editor.scan!==void 0&&(this.editor.editable.length>0||!or(r??"look"));r!==void 0&&n?this.editor.setTool(r):t==="backspace"&&this.editor.draft?.kind==="polygon"?this.editor.preview(ve(this.editor.draft)):t==="f"?this.stage?.viewer?.frame():t==="b"&&this.stage?.viewer?.setLook({before:!0})};isMeant(e){let t=e.composedPath();return t.includes(this)||t[0]===document.body}keyUp=e=>{e.key.toLowerCase()==="b"&&this.stage?.viewer?.setLook({before:!1})}};function Jn(o){let e=o.composedPath()[0];return e instanceof HTMLTextAreaElement||e instanceof HTMLInputElement&&!["checkbox","radio","range","button"].includes(e.type)}customElements.define("darn-editor",ir);
