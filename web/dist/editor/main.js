function re({hole:o}){return(o.patchUvs?.length??0)>0}function $(o,e){if(!re(o))return;let{patchFaces:t=[],patchUvs:r=[],id:n=0}=o.hole,s=i=>[r[2*i],r[2*i+1]];for(let i=0;i+2<t.length;i+=3){let a=t.slice(i,i+3),d=bo(e,a.map(s));if(d!==void 0)return{hole:n,uv:e,vertices:a,weights:d}}}function W({positions:o},{vertices:e,weights:t}){return[0,1,2].map(r=>e.reduce((n,s,i)=>n+t[i]*o[3*s+r],0))}function G({positions:o},{vertices:e}){let[t,r,n]=e.map(c=>[...o.subarray(3*c,3*c+3)]),[s,i]=[pt(r,t),pt(n,t)],a=[s[1]*i[2]-s[2]*i[1],s[2]*i[0]-s[0]*i[2],s[0]*i[1]-s[1]*i[0]],d=Math.hypot(...a)||1;return a.map(c=>c/d)}function be(o){let{rimUvs:e=[]}=o.hole,t=e.length/2||1,r=[0,1].map(i=>e.reduce((a,d,c)=>c%2===i?a+d:a,0)/t),n=o.hole.patchUvs??[],s={uv:r,distance:Number.POSITIVE_INFINITY};for(let i=0;i+1<n.length;i+=2){let a=[n[i],n[i+1]],d=Math.hypot(a[0]-r[0],a[1]-r[1]);d<s.distance&&(s={uv:a,distance:d})}return s.uv}function br(o,e){let t;for(let r of o){let n=r.hole.rimPositions??[];for(let s=0;s+2<n.length;s+=3){let i=Math.hypot(...pt(n.slice(s,s+3),e));i<(t?.distance??Number.POSITIVE_INFINITY)&&(t={patch:r,distance:i})}}return t?.patch}function pt(o,e){return[o[0]-e[0],o[1]-e[1],o[2]-e[2]]}function bo([o,e],[t,r,n]){let s=(r[0]-t[0])*(n[1]-t[1])-(n[0]-t[0])*(r[1]-t[1]);if(s===0)return;let i=((o-t[0])*(n[1]-t[1])-(n[0]-t[0])*(e-t[1]))/s,a=((r[0]-t[0])*(e-t[1])-(o-t[0])*(r[1]-t[1]))/s,d=1-i-a,c=-1e-6;return d>=c&&i>=c&&a>=c?[d,i,a]:void 0}var vr=new Map([["HOLE",{plural:"Holes",singular:"Hole",color:"#d9480f",line:"solid"}],["OPENING",{plural:"Openings",singular:"Opening",color:"#9c5fd0",line:"dotted"}],["TUBE_END",{plural:"Ends of sleeves",singular:"End of a sleeve",color:"#37a04d",line:"dotted"}],["OUTER_BOUNDARY",{plural:"Borders",singular:"Border",color:"#3f86c9",line:"dashed"}]]);function ne(o){let e=o.toLowerCase().replaceAll("_"," "),t=e.charAt(0).toUpperCase()+e.slice(1);return vr.get(o)??{plural:t,singular:t,color:"#862e9c",line:"dotted"}}function P(o){return o.kind==="HOLE"}function wr(o){return o.kind!=="OUTER_BOUNDARY"}function z(o){let e=[...vr.keys()],t=new Map(e.map(n=>[n,[]]));for(let n of o){let s=n.kind??"LOOP_KIND_UNSPECIFIED";t.set(s,[...t.get(s)??[],n])}let r=n=>n.length??0;return[...t].filter(([,n])=>n.length>0).map(([n,s])=>[n,s.sort((i,a)=>r(a)-r(i))])}function g(o){return o===void 0||!Number.isFinite(o)?"\u2013":o!==0&&(Math.abs(o)>=1e6||Math.abs(o)<.001)?o.toExponential(2):String(Number(o.toPrecision(3)))}function M(o){return o.kind==="cut"||o.kind==="polygon"||o.kind==="border"}function xr(o){return o.kind!=="polygon"||o.corners.length>=3}var S={grab:"Grab",twist:"Twist",pinch:"Pinch",anchor:"Anchor",cut:"Cut out",polygon:"Cut out",border:"Border"},ft=.125;function mt(o,e){let t=e.hole.id??0,r=be(e),n=$(e,r);switch(o){case"grab":return{kind:o,hole:t,uv:r,offset:[0,0,0]};case"twist":return{kind:o,hole:t,uv:r,radius:ft,axis:n?G(e,n):[0,1,0],angle:0};case"pinch":return{kind:o,hole:t,uvs:[r,[r[0]+.1,r[1]]],amount:.5};case"anchor":return{kind:o,hole:t,position:n?W(e,n):[0,0,0],hard:!1}}}function yt({border:o}){let e=({from:r,to:n})=>({from:ve(r),to:ve(n)}),t=o?.facing;return{kind:"border",...e(o??{}),along:[],...t&&{facing:e(t)}}}function we(o,{loops:e,candidates:t}){let r=kr(e),n=ve(r?.centroid);switch(o){case"cut":{let s=(r?.diameter??1)*(r?.kind==="HOLE"?.55:.05);return{kind:o,center:n,radius:s}}case"polygon":return{kind:o,corners:[]};case"border":{let[s]=t;return s?yt(s):{kind:o,from:n,to:n,along:[]}}}}function kr(o){return z(o)[0]?.[1][0]}function Pr(o,e){let{corners:t}=o;return{...o,corners:[...t,t.at(-1)??ve(kr(e)?.centroid)]}}function xe(o,e,t){return{...o,corners:o.corners.map((r,n)=>n===e?t:r)}}function ke(o){return{...o,corners:o.corners.slice(0,-1)}}function gt({corners:o,depth:e}){let t=r=>Math.max(...o.map(n=>oe(r,n)));return e??Math.max(0,...o.map(t))/10}function ve([o=0,e=0,t=0]=[]){return[o,e,t]}function N({from:o,to:e,along:t,facing:r}){return r?[o,e,r.from,r.to]:[o,e,...t]}function Ar({facing:o}){return o?4:2}function Pe(o,e,t){let r=N(o).with(e,t);if(o.facing===void 0){let[d,c,...l]=r;return{...o,from:d,to:c,along:l}}let[n,s,i,a]=r;return{...o,from:n,to:s,facing:{from:i,to:a}}}function Sr({from:o,to:e}){return{kind:"border",from:o,to:e,along:[],facing:{from:o,to:e}}}function $r({from:o,to:e}){return{kind:"border",from:o,to:e,along:[]}}function Mr({from:o,to:e,along:t,facing:r}){if(r===void 0)return[[o,...t,e]];let n=oe(o,r.from)+oe(e,r.to),s=oe(o,r.to)+oe(e,r.from),[i,a]=n<=s?[r.from,r.to]:[r.to,r.from];return[[o,i],[e,a]]}function oe(o,e){return Math.hypot(o[0]-e[0],o[1]-e[1],o[2]-e[2])}function Cr(o){switch(o.kind){case"cut":return{cut:{center:[...o.center],radius:o.radius}};case"polygon":return{cut:{polygon:o.corners.map(e=>[...e]),depth:gt(o)}};case"border":{let e=o.along.map(n=>[...n]),t=o.facing&&{from:[...o.facing.from],to:[...o.facing.to]};return{border:{...{from:[...o.from],to:[...o.to]},...e.length>0&&{along:e},...t&&{facing:t}}}}}}function bt(o,e){return{...o,edits:[...o.edits,vo(e)]}}function Ae(o,{hole:e,position:t,hard:r,replaces:n},s){let i={hole:e,uv:[...s],position:[...t],...r&&{hard:r}},{anchors:a}=o,d=n===void 0||n>=a.length;return{...o,anchors:d?[...a,i]:a.with(n,i)}}function vt(o,e){if(!M(e))return e.kind==="anchor"?e.uv&&Ae(o,e,e.uv):bt(o,e)}function vo(o){let{hole:e}=o;switch(o.kind){case"grab":return{hole:e,grab:{uv:[...o.uv],offset:[...o.offset]}};case"twist":return{hole:e,twist:{uv:[...o.uv],radius:o.radius,axis:[...o.axis],angle:o.angle}};case"pinch":return{hole:e,pinch:{uvs:o.uvs.map(t=>[...t]),amount:o.amount}}}}var I=class{running;waiting;offer(e){if(this.running!==void 0){this.waiting=e;return}this.running=this.run(e)}async settled(){this.waiting=void 0,await this.running}async run(e){for(let t=e;t!==void 0;)await t(),t=this.waiting,this.waiting=void 0;this.running=void 0}};var w=class extends Error{constructor(t,r,n,s,i=[]){super(n);this.status=t;this.code=r;this.retryAfter=s;this.fields=i}status;code;retryAfter;fields;name="ProblemError";get keyIsRefused(){return this.status===401}get sessionIsGone(){return this.status===410||this.code==="session_not_found"}};function $e(o,e,t){let r=Number(e??Number.NaN),n=Number.isFinite(r)&&r>=0?r:void 0;try{let{code:s,detail:i,errors:a=[]}=JSON.parse(t);return new w(o,s??"",i??Tr(o),n,a)}catch{return new w(o,"",Tr(o),n)}}function wt(o){return o instanceof w?wo(o):o instanceof TypeError&&/fetch|network/i.test(o.message)?"The service cannot be reached.":Se(o instanceof Error?o.message:String(o))}function se(o){return o instanceof DOMException&&o.name==="AbortError"}function Tr(o){return`The service answered with status ${o}.`}function wo({code:o,message:e,fields:t}){if(o==="anchor_out_of_reach"&&t.length>0)return[...t.map(({pointer:i="",detail:a=""})=>Se(`${Er(i)}: ${a}`)),"Move the point nearer to the cloth, or make the anchor soft."].join(`
`);let n=t.filter(({detail:s=""})=>!e.includes(s)).map(({pointer:s="",detail:i=""})=>Se(`${Er(s)}: ${i}`));return[Se(e),...n].join(`
`)}function Er(o){let[,e="",t=""]=o.split("/"),r=new Map([["anchors","Anchor"],["edits","Gesture"]]).get(e);return r!==void 0&&/^\d+$/.test(t)?`${r} ${Number(t)+1}`:o||"The request"}function Se(o){let e=o.charAt(0).toUpperCase()+o.slice(1);return/[.!?]$/.test(e)?e:`${e}.`}var ie=class o{constructor(e,t,r,n){this.service=e;this.scan=t;this.selection=r;this.opened=n}service;scan;selection;opened;live=new I;met;static async open(e,t,r={},n={}){return new o(e,t,r,await e.openSession(t,r,n))}get holes(){return this.opened.holes??[]}get skipped(){return this.opened.skipped??[]}get cutFaces(){return this.opened.cutFaces??[]}drag(e,{onPatches:t,onError:r}){this.live.offer(async()=>{try{t(await this.draft(e))}catch(n){r(n)}})}async release(e,t={}){return await this.live.settled(),this.mend(e,t)}draft(e,t={}){return this.within(t,async r=>{let n=await this.service.draft(r,e,t),s=n.length/2,i=this.byHole(n.subarray(s));return this.byHole(n.subarray(0,s)).map((a,d)=>({...a,normals:i[d].positions}))})}positions(e,t={}){return this.within(t,async r=>{let n=await this.meeting(e,()=>this.service.positions(r,e,t));return this.byHole(n)})}mend(e,t={}){return this.within(t,async r=>{let{positions:n,report:s}=await this.meeting(e,()=>this.service.mend(r,e,t));return{patches:this.byHole(n),report:s}})}patches(e,t={}){return this.within(t,r=>this.meeting(e,()=>this.service.patches(r,e,t)))}optimizeAnchor(e,t={}){return this.within(t,r=>this.service.optimizeAnchor(r,e,t))}anchorMap(e,t,r={}){return this.within(r,n=>this.service.anchorMap(n,e,t,r))}result(e,t={}){return this.within(t,async r=>(await this.meet(r,e,t),this.service.result(r,t)))}close(){this.service.close(this.id)}get id(){return this.opened.id??""}async meet(e,t,r){this.met!==JSON.stringify(t)&&await this.meeting(t,()=>this.service.mend(e,t,r))}async meeting(e,t){this.met=void 0;let r=await t();return this.met=JSON.stringify(e),r}async within(e,t){try{return await t(this.id)}catch(r){if(!(r instanceof w&&r.sessionIsGone))throw r;return this.met=void 0,this.opened=await this.service.openSession(this.scan,this.selection,e),t(this.id)}}byHole(e){let t=0;return this.holes.map(r=>{let n=t+3*xo(r),s=e.subarray(t,n);return t=n,{hole:r,positions:s}})}};function xo({patchUvs:o=[],patchFaces:e=[]}){return o.length>0?o.length/2:e.reduce((t,r)=>Math.max(t,r+1),0)}async function*Dr(o,e){let t=o.getReader(),r=new TextDecoder,[n,s,i]=["","",[]];try{for(;;){let{done:a,value:d}=await ko(t.read(),e);if(a)return;n+=r.decode(d,{stream:!0});let c=n.split(/\r\n|\n|\r(?!$)/);n=c.pop()??"";for(let l of c){if(l===""){i.length>0&&(yield{id:s,data:i.join(`
`)}),i=[];continue}let[,h,u]=/^([^:]*)(?:: ?(.*))?$/.exec(l)??[];h==="data"?i.push(u??""):h==="id"&&(s=u??"")}}}finally{t.cancel().catch(()=>{})}}function ko(o,e){return new Promise((t,r)=>{let n=setTimeout(()=>r(new Error("The service says nothing any more.")),e);o.then(t,r).finally(()=>clearTimeout(n))})}var Po=5,Ao=60;function Lr(o,e={}){return typeof XMLHttpRequest>"u"?xt(o.url,{method:"POST",headers:o.headers,body:o.body},e):Me(e,()=>So(o,e))}function xt(o,e,t={}){return Me(t,async()=>{let r=await kt(o,{...e,signal:t.signal??null});return{contentType:r.headers.get("content-type")??"",body:await r.arrayBuffer()}})}async function kt(o,e){let t=await fetch(o,e);if(!t.ok)throw $e(t.status,t.headers.get("retry-after"),await t.text());return t}async function Rr(o,e){let t=o.body?.getReader(),r=new TextDecoder,n="";for(;;){let{done:s,value:i}=await t?.read()??{done:!0,value:void 0};n+=r.decode(i,{stream:!s});let a=n.split(`
`);n=s?"":a.pop()??"";for(let d of a.filter(c=>c!==""))e(JSON.parse(d));if(s)return}}function A(o){return JSON.parse(new TextDecoder().decode(o.body))}async function Me(o,e){for(let t=1;;t+=1)try{return await e()}catch(r){let n=r instanceof w&&r.status===503?r.retryAfter:void 0;if(n===void 0||n>Ao||t===Po)throw r;o.onWait?.(n),await Pt(n,o.signal)}}function Pt(o,e){return new Promise((t,r)=>{let n=()=>{clearTimeout(s),r(new DOMException("stopped","AbortError"))},s=setTimeout(()=>{e?.removeEventListener("abort",n),t()},o*1e3);e?.aborted&&n(),e?.addEventListener("abort",n,{once:!0})})}function So({url:o,headers:e,body:t},{onSent:r,signal:n}){return new Promise((s,i)=>{let a=new XMLHttpRequest;a.open("POST",o);for(let[d,c]of Object.entries(e))a.setRequestHeader(d,c);a.responseType="arraybuffer",a.upload.onprogress=d=>{d.lengthComputable&&d.total>0&&r?.(d.loaded/d.total)},a.onload=()=>{let d=a.response;if(a.status<400)s({contentType:a.getResponseHeader("content-type")??"",body:d});else{let c=new TextDecoder().decode(d);i($e(a.status,a.getResponseHeader("retry-after"),c))}},a.onerror=()=>i(new Error("The service cannot be reached, or it closed the connection.")),a.onabort=()=>i(new DOMException("stopped","AbortError")),n?.addEventListener("abort",()=>a.abort()),a.send(t)})}var $o=45e3,At={first:.5,longest:30},ae=class{constructor(e){this.transport=e}transport;async submit(e,t,r={},n={}){let s=new FormData;s.append("scan",e,"scan"),s.append("constraints",new Blob([JSON.stringify(t)],{type:"application/json"}),"constraints");let{name:i,priority:a,webhook:d,idempotencyKey:c=crypto.randomUUID()}=r,l=`jobs${Or({name:i,priority:a,webhook:d})}`;return A(await this.transport.upload(l,s,n,{"idempotency-key":c}))}async get(e,t={}){return A(await this.transport.send(H(e),{},t))}async list({state:e,from:t,limit:r}={},n={}){return A(await this.transport.send(`jobs${Or({state:e,from:t,limit:r})}`,{},n))}async result(e,t={}){let r=await this.transport.send(H(e,"result"),{},t);return new Blob([r.body],{type:r.contentType})}async report(e,t={}){return A(await this.transport.send(H(e,"report"),{},t))}async cancel(e,t={}){return A(await this.transport.send(H(e,"cancel"),{method:"POST"},t))}async retry(e,t={}){return A(await this.transport.send(H(e,"retry"),{method:"POST"},t))}async delete(e,t={}){await this.transport.send(H(e),{method:"DELETE"},t)}async*events(e,{lastVersion:t,signal:r}={}){let n=t;for(let s=At.first;;){try{let i=await this.transport.open(H(e,"events"),{headers:n===void 0?{}:{"last-event-id":String(n)},signal:r??null});if(i.status===204||i.body===null)return;for await(let a of Dr(i.body,$o)){let d=JSON.parse(a.data);if([n,s]=[d.version,At.first],yield d,St(d))return}}catch(i){if(se(i)||r?.aborted||i instanceof w&&!Mo(i))throw i;s=Math.max(s,i instanceof w&&i.retryAfter||0)}await Pt(s,r),s=Math.min(2*s,At.longest)}}async wait(e,{onChange:t,...r}={}){for await(let n of this.events(e,r))if(t?.(n),St(n))return n;return this.get(e,r)}};function St(o){return o.state==="DONE"||o.state==="ERROR"||o.state==="CANCELLED"}function Mo({status:o}){return o===429||o>=500}function H(o,e){let t=`jobs/${encodeURIComponent(o)}`;return e===void 0?t:`${t}/${e}`}function Or(o){let e=Object.entries(o).filter(([,r])=>r!==void 0),t=new URLSearchParams(e.map(([r,n])=>[r,String(n)])).toString();return t===""?"":`?${t}`}function $t(o,e){let t=/boundary="?([^";]+)"?/.exec(o)?.[1];if(!o.startsWith("multipart/mixed")||t===void 0)throw new Error(`multipart/mixed was asked for, ${o} was answered`);let r=new Uint8Array(e),n=new Map,s=0;for(;;){let i=Co(r,`\r
\r
`,s);if(i<0){if(!new TextDecoder().decode(r.subarray(s)).startsWith(`--${t}--`))throw new Error("a multipart/mixed answer ends before its last line");return n}let a=new TextDecoder().decode(r.subarray(s,i)).toLowerCase(),d=Number(/content-length: *(\d+)/.exec(a)?.[1]??Number.NaN),c=/name="([^"]*)"/.exec(a)?.[1],l=i+4;if(!a.includes(`--${t.toLowerCase()}`)||c===void 0||!(l+d<=r.length))throw new Error("a part of a multipart/mixed answer cannot be read");let h=/content-type: *([^\r\n;]+)/.exec(a)?.[1]??"";n.set(c,{mediaType:h,body:r.slice(l,l+d)}),s=l+d+2}}function Co(o,e,t){let r=[...e].map(s=>s.charCodeAt(0)),n=o.length-r.length;for(let s=t;s<=n;s+=1)if(r.every((i,a)=>o[s+a]===i))return s;return-1}function de(o){return{method:"POST",headers:{"content-type":"application/json"},body:JSON.stringify(o)}}var Ce=class{constructor(e,t){this.base=e;this.options=t;this.key=t.key}base;options;key;asked;send(e,t,r={}){return this.withKey(n=>xt(this.at(e),Fr(t,n),r))}open(e,t){return this.withKey(r=>kt(this.at(e),Fr(t,r)))}openPatiently(e,t,r){return Me(r,()=>this.open(e,t))}upload(e,t,r,n={}){return this.withKey(s=>Lr({url:this.at(e),headers:{...n,...Mt(s)},body:t},r))}forget(e,t){fetch(this.at(e),{method:t,keepalive:!0,headers:Mt(this.key)}).catch(()=>{})}async withKey(e){for(;;){let t=this.key;try{return await e(t)}catch(r){if(!(r instanceof w&&r.keyIsRefused))throw r;if(this.key===t){let n=await this.ask(r);if(n===void 0)throw r;this.key=n}}}}ask(e){return this.asked??=Promise.resolve(this.options.askForKey?.(e)).finally(()=>this.asked=void 0),this.asked}at(e){return new URL(e,this.base)}};function Fr(o,e){return{...o,headers:{...o.headers,...Mt(e)}}}function Mt(o){return o===void 0?{}:{authorization:`Bearer ${o}`}}var ce=class{constructor(e,t={}){this.base=e;this.transport=new Ce(e,t),this.jobs=new ae(this.transport)}base;jobs;transport;async info(){return A(await this.transport.send("info",{}))}async holes(e,t){let r=new FormData;return r.append("scan",e,"scan"),A(await this.transport.upload("holes",r,t))}async openSession(e,t,r){let n=new FormData;return n.append("scan",e,"scan"),n.append("constraints",new Blob([JSON.stringify(t)],{type:"application/json"}),"constraints"),A(await this.transport.upload("sessions",n,r))}async positions(e,t,r){let n=await this.inpaint(e,t,"application/octet-stream",r);return new Float32Array(n.body)}async draft(e,t,r){let n=await this.transport.send(`sessions/${e}/inpaint?draft=true`,de(t),r);return new Float32Array(n.body)}async mend(e,t,r){let s=await this.inpaint(e,t,"multipart/mixed, application/octet-stream;q=0.9",r),{report:i,patches:a}=Br(s);return{report:i,positions:new Float32Array(a.buffer)}}async patches(e,t,r){let n="multipart/mixed, model/gltf-binary;q=0.9",{report:s,patches:i}=Br(await this.inpaint(e,t,n,r));return{report:s,glb:i.buffer}}async optimizeAnchor(e,t,r){return A(await this.transport.send(`sessions/${e}/optimize-anchor`,de(t),r))}async anchorMap(e,t,r,n){let s=de({...t,map:!0});s.headers={...s.headers,accept:"application/x-ndjson"},s.signal=n.signal??null;let i=({found:a,map:d,problem:c})=>{if(c!==void 0){let{status:l=500,code:h="",detail:u="",errors:p=[]}=c;throw new w(l,h,u,void 0,p)}a!==void 0&&r.onFound(a),d!==void 0&&r.onMap(d)};await Rr(await this.transport.openPatiently(`sessions/${e}/optimize-anchor`,s,n),i)}async result(e,t){let r=await this.transport.send(`sessions/${e}/result`,{},t);return new Blob([r.body],{type:r.contentType})}close(e){this.transport.forget(`sessions/${e}`,"DELETE")}inpaint(e,t,r,n){let s=de(t);return s.headers={...s.headers,accept:r},this.transport.send(`sessions/${e}/inpaint`,s,n)}};function Br(o){let e=$t(o.contentType,o.body),[t,r]=[e.get("report"),e.get("patches")];if(t===void 0||r===void 0)throw new Error("the answer has no report or no patches");return{report:JSON.parse(new TextDecoder().decode(t.body)),patches:r.body}}var Te=class{constructor(e,t){this.hole=e;this.target=t}hole;target;losses=Array.from({length:4096},()=>null);known=0;total;stopped=new AbortController;get signal(){return this.stopped.signal}get share(){return this.total===void 0?0:Math.min(this.known/Math.max(this.total,1),1)}get isComing(){return!this.signal.aborted&&(this.total===void 0||this.known<this.total)}add({cells:e=[],losses:t=[],total:r=0}){e.forEach((n,s)=>this.losses[n]=t[s]??null),this.known+=e.length,this.total=r}stop(){this.stopped.abort()}};var Ee=class{constructor(e){this.searched=e}searched;last;drawn;get found(){return this.last}get map(){return this.drawn}async find({hole:e,position:t},r){this.drawn!==void 0&&this.drawn.target.join()!==t.join()&&this.dropMap();let n={hole:e,target:[...t]},s=await this.searched.session()?.optimizeAnchor(this.searched.step(),n,r);if(s!==void 0)return this.last={hole:e,found:s},this.searched.say(`Found after ${s.evaluations} evaluations of the network.`),s.uv}async drawMap({hole:e,position:t}){this.stopMap();let r=new Te(e,t);this.drawn=r,this.searched.say("The map is being drawn.");try{let n={onFound:i=>{this.last={hole:e,found:i},this.searched.changed()},onMap:i=>{r.add(i),this.searched.changed()}},s={hole:e,target:[...t]};await this.searched.session()?.anchorMap(this.searched.step(),s,n,{signal:r.signal}),this.searched.say("The map is complete.")}catch(n){r.stop(),this.searched.report(n)}}stopMap(){this.drawn?.isComing&&(this.drawn.stop(),this.searched.say("The map is stopped."))}forget(){this.last=void 0,this.dropMap()}dropMap(){this.drawn?.stop(),this.drawn=void 0}};function De(o){return Number.isInteger(o)&&o>=0&&o<8}function D(o){return`Fill ${o+1} of 8`}function Ct(o,e){let t=Tt(o,e),r=o===0?"the likeliest":"beside the likeliest";return t===void 0?`${D(o)}, ${r}.`:`${D(o)}. ${t}`}function Tt(o,e){let t=e?.holes??[];if(!(o===0||t.length===0||t.some(({patch:r})=>(r?.alternative??0)>0)))return t.length===1?"A smooth surface closes this hole: it has one fill only, which is shown.":"Smooth surfaces close these holes: each has one fill only, which is shown."}var q=[["synthesize","Images of its own"],["continue","The scan\u2019s images go on"],["flat","One colour"],["none","Grey"]],Et="As darn decides";function Nr(o){return o===void 0||q.some(([e])=>e===o)}function le(o){let e=q.find(([t])=>t===o)?.[1]??Et;return`Colour of the new cloth: ${e.charAt(0).toLowerCase()}${e.slice(1)}`}var To={synthesize:"synthesized",continue:"continued",flat:"flat",none:"none"};function Ir(o,e){let t=(e?.holes??[]).filter(s=>o!==void 0&&s.texture!==void 0&&s.texture.method!==To[o]),r=t.map(({id:s})=>s).join(", "),n=t.length===0?"":` Not in ${t.length===1?"hole":"holes"} ${r}: see the report.`;return`${le(o)}.${n}`}function Hr({method:o,reason:e="",width:t=0,height:r=0}){return`Its colour: ${new Map([["synthesized",`images of its own, ${t} \xD7 ${r} texels`],["continued","that of the scan goes on"],["flat","one, the mean of the cloth around the hole"],["none","grey"]]).get(o??"")??o}${e===""?"":`; ${e}`}.`}var Eo=["fill","except","maxDiameter","minDiameter"],Le={anchors:[],edits:[],alternative:0,texture:void 0};function Vr({anchors:o,edits:e,...t},r,n){let s=({rimPositions:c=[]})=>c.join(),i=new Map(n.map(c=>[s(c),c.id??0])),a=new Map(r.map(c=>[c.id??0,i.get(s(c))])),d=c=>{let l=c.hole===void 0?void 0:a.get(c.hole);return c.hole===void 0?[c]:l===void 0?[]:[{...c,hole:l}]};return{anchors:o.flatMap(d),edits:e.flatMap(d),...t}}function K(o){return{...o.anchors.length>0&&{anchors:[...o.anchors]},...o.edits.length>0&&{edits:[...o.edits]},...o.alternative>0&&{alternative:o.alternative},...o.texture!==void 0&&{texture:o.texture}}}function Ur(o,{holes:e,made:t,acceptDoubtful:r,selection:n,more:s}){if(n!==void 0)return{...n,...s,...r&&{acceptDoubtful:r}};let i=h=>h.id??0,a=o.filter(P).map(i),c=[...o.filter(h=>!P(h)&&e.includes(i(h))).map(h=>({id:i(h)})),...t],l=a.filter(h=>!e.includes(h));return{...c.length>0&&{holes:c},...c.length>0&&l.length<a.length&&{fill:"holes"},...l.length>0&&{except:l},...s,...r&&{acceptDoubtful:r}}}function jr(o,{holes:e,made:t,acceptDoubtful:r,selection:n,more:s},i){let a=e.filter(d=>o.some(c=>(c.id??0)===d));return{...n??{holes:[...a.map(d=>({id:d})),...t]},...s,...r&&{acceptDoubtful:r},...K(i)}}function _r(o){let e;try{e=JSON.parse(o)}catch(y){throw new Error(`The constraints are not JSON: ${y instanceof Error?y.message:String(y)}`)}if(typeof e!="object"||e===null||Array.isArray(e))throw new Error("The constraints must be a JSON object.");let{holes:t,acceptDoubtful:r=!1,anchors:n=[],edits:s=[],alternative:i=0,texture:a,...d}=e;if(!Dt(n)||!Dt(s))throw new Error("`anchors` and `edits` must be lists of objects.");if(typeof r!="boolean")throw new Error("`acceptDoubtful` must be true or false.");if(!De(i))throw new Error(`\`alternative\` must be a whole number from 0 to ${7}.`);if(!Nr(a))throw new Error(`\`texture\` must be one of ${q.map(([y])=>y).join(", ")}.`);let c=y=>Eo.includes(y),l=Object.entries(d),h=Object.fromEntries(l.filter(([y])=>c(y))),u=Object.fromEntries(l.filter(([y])=>!c(y))),{isOwn:p,...f}=Do(t),v=p&&Object.keys(h).length===0?void 0:{...t!==void 0&&{holes:t},...h};return{...f,acceptDoubtful:r,selection:v,more:u,constraints:{anchors:n,edits:s,alternative:i,texture:a}}}function Wr({holes:o,made:e,acceptDoubtful:t,selection:r,more:n},s,i){let a=i.filter(P).map(c=>c.id??0);return{holes:[...o??(s.holes.length>0?s.holes:a)].sort((c,l)=>c-l),made:e,acceptDoubtful:t,selection:r,more:n}}function Do(o){if(o===void 0)return{holes:void 0,made:[],isOwn:!0};if(!Dt(o))throw new Error("`holes` must be a list of objects.");let e=[],t=[],r=!0;for(let n of o)typeof n.id=="number"&&Number.isInteger(n.id)?e.push(n.id):typeof n.cut=="object"?t.push({cut:n.cut}):n.border==="auto"?t.push({border:{auto:!0}}):typeof n.border=="object"?t.push({border:n.border}):r=!1;return{holes:e,made:t,isOwn:r}}function Dt(o){return Array.isArray(o)&&o.every(e=>typeof e=="object"&&e!==null)}var Re={label:"Open",holes:[],made:[],acceptDoubtful:!1,selection:void 0,more:{},constraints:Le,patches:[],cutFaces:[],report:void 0};var Lo="darn reconstruction";function Oe(o){return o.byteLength>=20&&new TextDecoder().decode(o.slice(0,4))==="glTF"}function Rt(o){return o.slice(20,20+new DataView(o).getUint32(12,!0))}function J(o){let e=Oe(o)?Rt(o):o;try{return JSON.parse(new TextDecoder().decode(e))}catch{return{}}}function Fe({images:o=[],meshes:e=[]}){let t=e.flatMap(({primitives:r=[]})=>r.flatMap(n=>Object.keys(n.attributes??{})));return o.length>0||t.some(r=>r.startsWith("COLOR_"))}function Gr({meshes:o=[],materials:e=[]},t){let r=new Map;for(let[n,s]of t.entries()){let{name:i,pbrMetallicRoughness:a}=e[o[n]?.primitives?.[0]?.material??-1]??{};if(i!==Lo||a===void 0||a.baseColorTexture!==void 0)continue;let{baseColorFactor:d=[1,1,1],roughnessFactor:c=1,metallicFactor:l=1}=a;r.set(s,{color:d.slice(0,3),roughness:c,metalness:l})}return r}var he=class{states;at=0;constructor(e){this.states=[e]}get present(){return this.states[this.at]}get canUndo(){return this.at>0}get canRedo(){return this.at+1<this.states.length}get next(){return this.states[this.at+1]}push(e){this.states.length=this.at+1,this.states.push(e),this.at+=1}undo(){this.at=Math.max(this.at-1,0)}redo(){this.at=Math.min(this.at+1,this.states.length-1)}};var Be=class{constructor(e){this.drafted=e}drafted;made;answered;asking=!1;live=new I;get draft(){return this.made}get patches(){return this.answered}get isAsking(){return this.asking}show(e){this.made=e,this.drafted.changed(),vt(this.drafted.step().constraints,e)!==void 0&&this.live.offer(()=>this.ask(e))}drop(){this.made=void 0,this.answered=void 0,this.drafted.changed()}settled(){return this.live.settled()}async ask(e){let[t,r]=[this.drafted.step(),this.drafted.session()],n=vt(t.constraints,e);if(!(this.made!==e||r===void 0||n===void 0)){this.asking=!0;try{let s=await r.preview(t,n);this.made!==void 0&&this.drafted.step()===t&&(this.answered=s)}catch(s){this.drafted.report(s)}finally{this.asking=!1,this.drafted.changed()}}}};var Ro="The cloth around it cannot be laid flat: a fair surface without folds, which takes no gestures.",Oo=1.645;function zr(o){let e=o.patch??{},t=(e.faces??0).toLocaleString("en"),r=e.alternative??0,n=[`Hole ${o.id}: ${t} new triangles, area ${g(e.area)}, on a rim of length ${g(o.length)}.`,`${Fo(e.stretchMean,e.stretchMax)} ${Bo(e.selfIntersections??0)}`,e.method==="fair"?Ro:No(e.networkShare),r>0?Ct(r):"",o.texture===void 0?"":Hr(o.texture),Io(e.confidence,(o.anchors??[]).length+(o.edits??[]).length)];if(o.cut!==void 0&&(o.cut.faces??0)>0){let s=(o.cut.faces??0).toLocaleString("en");n.push(`${s} triangles of the scan were cut out first, area ${g(o.cut.area)}.`)}for(let s of o.anchors??[]){let i=s.beyondReach??0,a=i>0?`; ${g(i)} of that is beyond the cloth's reach`:"";n.push(`An anchor is ${g(s.distance)} away from the cloth${a}.`)}for(let s of o.edits??[])n.push(`A gesture is followed to within ${g(s.distance)}.`);return[...n,...(o.doubts??[]).map(s=>`Doubtful: ${s}.`),...o.notes??[]].filter(s=>s!=="")}function qr(o){let e=o.holes?.length??0,t=o.skipped?.length??0,r=t===1?"1 loop is":`${t} loops are`;return`${Jr(e,"hole")} filled; ${r} left open.`}function Kr({label:o,constraints:e,patches:t,report:r}){if(o===D(e.alternative))return Ct(e.alternative,r);if(o===le(e.texture))return Ir(e.texture,r);let n=t.reduce((s,i)=>s+(i.hole.patchFaces?.length??0)/3,0);return`${o}: ${t.length} filled, ${n.toLocaleString("en")} new triangles.`}function Fo(o,e){return o===void 0||e===void 0?"":`Lengths differ from those of flat cloth by ${Ot(o-1)} on average, ${Ot(e-1)} at most.`}function Bo(o){return o===0?"No triangles cross.":`${Jr(o,"pair")} of triangles cross.`}function No(o){return o===void 0?"":o>=.995?"The network predicts its folds.":o<=.005?"A fair surface without folds, as the cloth around it has none.":`${Ot(o)} of the network's folds, for the rest a fair surface.`}function Io(o,e){if(o?.median===void 0)return"";let r=[["very high",o.veryHigh],["high",o.high],["medium",o.medium],["low",o.low],["very low",o.veryLow]].map(([i,a=0])=>[i,Math.round(100*a)]).filter(([,i])=>i>0).map(([i,a])=>`${i} at ${a} %`),n=e>0?"Before anchors and gestures, half":"Half",s=g(Oo*o.median);return`${n} of the new vertices have nine chances in ten to lie within ${s} of the cloth that was there; confidence is ${r.join(", ")} of the vertices.`}function Ot(o){return`${Number((Math.abs(o)*100).toPrecision(2))} %`}function Jr(o,e){return`${o} ${e}${o===1?"":"s"}`}var Ho=/\.(glb|gltf)$/i,Vo=[[/\.png$/i,"image/png"],[/\.jpe?g$/i,"image/jpeg"],[/\.webp$/i,"image/webp"]];async function Yr(o){let e=o.find(({name:n})=>Ho.test(n))??o[0];if(e===void 0)return;let{name:t}=e;if(!/\.gltf$/i.test(t))return{file:e,name:t};let r;try{r=JSON.parse(await e.text())}catch{return{file:e,name:t}}for(let n of[...r.buffers??[],...r.images??[]])n.uri!==void 0&&!n.uri.startsWith("data:")&&(n.uri=await jo(Uo(o,n.uri),n));return{file:new Blob([JSON.stringify(r)],{type:"model/gltf+json"}),name:t}}function Y(o="scan"){return o.replace(/\.(glb|gltf)$/i,"")}async function Xr(o,e){let t=await fetch(o,{signal:e??null});if(!t.ok)throw new Error(`${o.href} answered with status ${t.status}.`);return new Blob([await t.arrayBuffer()],{type:"model/gltf-binary"})}function Uo(o,e){let t=decodeURIComponent(e).split("/").pop(),r=o.find(({name:n})=>n===t);if(r===void 0)throw new Error(`The scan refers to the file ${t}; drop both together.`);return r}async function jo(o,e){let t=Vo.find(([i])=>i.test(o.name))?.[1],r=e.mimeType??t??"application/octet-stream",n=new Uint8Array(await o.arrayBuffer()),s="";for(let i=0;i<n.length;i+=32768)s+=String.fromCharCode(...n.subarray(i,i+32768));return`data:${r};base64,${btoa(s)}`}var Ne=class{constructor(e,t){this.service=e;this.scan=t}service;scan;opened;get skipped(){return this.opened?.cloth.skipped??[]}get cutFaces(){return this.opened?.cloth.cutFaces??[]}async holes(e,t){return(await this.open(e,t)).cloth.holes}async mend(e,t,r){let n=await this.open(e,r),s=await this.dress(n,t.texture,r),{patches:i,report:a}=await n.cloth.mend(K(t),r);return{patches:Zr(i,s),report:_o(a,s)}}async preview(e,t){let r=await this.open(e,{}),n=await this.dress(r,t.texture,{});return Zr(await r.cloth.draft(K(t)),n)}async optimizeAnchor(e,t,r){return(await this.open(e,r)).cloth.optimizeAnchor(t,r)}async anchorMap(e,t,r,n){await(await this.open(e,n)).cloth.anchorMap(t,r,n)}async result(e,t,r){return(await this.open(e,r)).cloth.result(K(t),r)}close(){this.opened?.cloth.close(),this.opened=void 0}async open(e,t){let r=Qr(e);if(this.opened!==void 0&&[this.opened.asked,this.opened.filled].includes(r))return this.opened;let{file:n,loops:s}=this.scan,i=await ie.open(this.service,n,Ur(s,e),t);this.close();let a=Qr({...e,holes:i.holes.map(({id:d=0})=>d)});return this.opened={asked:r,filled:a,cloth:i,dressings:new Map},this.opened}async dress({cloth:e,dressings:t},r,n){let s=t.get(r);if(s!==void 0)return s;let i=K({...Le,texture:r}),a=await e.positions(i,n),{glb:d,report:c}=await e.patches(i,n),l=c.holes??[],h=Fe(this.scan.document)?l:[],u={glb:d,positions:new Map(a.map(p=>[p.hole.id??0,p.positions])),textures:new Map(h.flatMap(({id:p=0,texture:f})=>f===void 0?[]:[[p,f]])),colours:Gr(J(d),l.map(({id:p=0})=>p))};return t.set(r,u),u}};function Qr({holes:o,made:e,acceptDoubtful:t,selection:r,more:n}){return JSON.stringify([o,e,t,r,n])}function Zr(o,e){return o.map(t=>({...t,dressing:e}))}function _o(o,{textures:e}){let t=(o.holes??[]).map(r=>{let n=e.get(r.id??0);return n===void 0?r:{...r,texture:n}});return{...o,holes:t}}var Ie=class{constructor(e){this.varied=e}varied;wanted;get isWaiting(){return this.wanted!==void 0}get newest(){return this.wanted??this.varied.step().constraints}async choose(e){let{isWaiting:t,varied:r}=this,{alternative:n,texture:s}=this.newest;if(this.wanted={alternative:n,texture:s,...e},t)return;let i;for(;r.step()!==i&&!r.isBusy();){i=r.step();let a=Wo(i.constraints,this.wanted);a!==void 0&&await r.apply(a.label,a.constraints)}this.wanted=void 0}};function Wo(o,{alternative:e,texture:t}){if(e!==o.alternative)return{label:D(e),constraints:{...o,alternative:e}};if(t!==o.texture)return{label:le(t),constraints:{...o,texture:t}}}var He=class extends EventTarget{constructor(t){super();this.service=t;this.limits=t.info().catch(()=>{})}service;scan;chosen=new Set;acceptDoubtful=!1;skipped=[];tool="look";twistRadius=ft;work;problem;message="";history=new he(Re);session;hand=new Be({step:()=>this.step,session:()=>this.session,changed:()=>this.changed(),report:t=>this.report(t)});search=new Ee({step:()=>this.step,session:()=>this.session,changed:()=>this.changed(),say:t=>this.say(t),report:t=>this.report(t)});wanted=new Ie({step:()=>this.step,isBusy:()=>this.work!==void 0,apply:(t,r)=>this.apply(t,this.step,r)});limits;get step(){return this.history.present}get draft(){return this.hand.draft}get draftPatches(){return this.hand.patches}get isAsking(){return this.hand.isAsking}get found(){return this.search.found}get map(){return this.search.map}get editable(){return this.step.patches.filter(re)}get alternative(){return this.wanted.newest.alternative}get texture(){return this.wanted.newest.texture}get canVary(){return this.step.patches.length>0&&(this.work===void 0||this.wanted.isWaiting)}get patches(){return this.draftPatches??this.step.patches}get undoLabel(){return this.history.canUndo?this.history.present.label:void 0}get redoLabel(){return this.history.next?.label}reportOf(t){return this.step.report?.holes?.find(r=>r.id===t)}async open(t,r){await this.working(`Sending ${r}`,async n=>{let s=(await this.limits)?.limits.bodyBytes;if(s!==void 0&&t.size+4096>s)throw new Error(`${r} has ${t.size} bytes; this service takes at most ${s}.`);let i=await t.arrayBuffer(),{loops:a=[],candidates:d=[],notes:c=[]}=await this.service.holes(t,n);this.session?.close(),this.scan={file:t,name:r,bytes:i,loops:a,candidates:d,notes:c,document:J(i)},this.session=new Ne(this.service,this.scan),this.history=new he(Re),this.chosen=new Set(a.filter(P).map(h=>h.id??0)),this.skipped=[],this.acceptDoubtful=!1,this.search.forget(),this.dropDraft();let l=this.chosen.size;this.message=`${r} is open: ${l} ${l===1?"hole":"holes"} in ${a.length} boundary loops.`,this.dispatchEvent(new Event("opened"))})}async openAddress(t){let r=decodeURIComponent(t.pathname.split("/").pop()??"")||t.host,n;await this.working(`Loading ${r}`,async({signal:s})=>{n=await Xr(t,s)}),n!==void 0&&await this.open(n,r)}choose(t){this.chosen=t,this.changed()}setAcceptDoubtful(t){this.acceptDoubtful=t,this.changed()}async mend(){let t=[...this.chosen].sort((s,i)=>s-i),r=`${t.length} ${t.length===1?"hole":"holes"}`,{acceptDoubtful:n}=this;await this.fill(`Mend ${r}`,{...this.step,holes:t,acceptDoubtful:n,selection:void 0})}async make(t,r){let{step:n}=this;await this.fill(t,{...n,made:[...n.made,r],selection:void 0})}async unmake(t){let{step:r}=this,n=r.made.filter(i=>i!==t),s=r.holes.filter(i=>this.scan?.loops.some(a=>a.id===i));s.length+n.length===0?(this.history.push({...Re,label:"Put back"}),this.say("Put back: nothing is mended.")):await this.fill("Put back",{...r,holes:s,made:n,selection:void 0})}preview(t){t.kind==="twist"&&(this.twistRadius=t.radius),this.hand.show(t)}setTwistRadius(t){let{draft:r}=this;r?.kind==="twist"?this.preview({...r,radius:t}):(this.twistRadius=t,this.say(`Twist: radius ${t.toFixed(3)} of the chart.`))}async commit(){let{draft:t}=this;if(t!==void 0)if(M(t))await this.make(S[t.kind],Cr(t));else if(t.kind==="anchor"&&t.uv!==void 0)await this.apply("Move anchor",this.step,Ae(this.step.constraints,t,t.uv));else if(t.kind==="anchor")await this.placeAnchor(t);else{let r=bt(this.step.constraints,t);await this.apply(S[t.kind],this.step,r)}}dropDraft(){this.hand.drop()}async chooseFill(t){De(t)&&await this.vary({alternative:t})}async vary(t){if(this.canVary){let r=this.wanted.choose(t);this.changed(),await r,this.changed()}}async drawMap(t){this.problem=void 0,await this.search.drawMap(t)}stopMap(){this.search.stopMap()}async placeAnchor(t){let r;if(await this.working("Searching",async n=>{r=await this.search.find(t,n)}),r!==void 0){let n=Ae(this.step.constraints,t,r);await this.apply(t.hard?"Hard anchor":S.anchor,this.step,n)}}undo(){this.travel(()=>this.history.undo(),"Undone")}redo(){this.travel(()=>this.history.redo(),"Redone")}setTool(t){this.tool=t,this.dropDraft()}constraintsText(){let t=jr(this.scan?.loops??[],this.step,this.step.constraints);return JSON.stringify(t,void 0,2)}async loadConstraints(t){let r;try{r=_r(t)}catch(s){this.report(s);return}let n=Wr(r,this.step,this.scan?.loops??[]);this.acceptDoubtful=n.acceptDoubtful,await this.apply("Load constraints",n,r.constraints),this.choose(new Set(this.step.holes))}async result(){let t;return await this.working("Saving",async r=>{let{holes:n,constraints:s}=this.step;t=await this.session?.result(this.step,s,r),this.message=`Saved with ${n.length} filled ${n.length===1?"hole":"holes"}.`}),t}say(t){this.message=t,this.changed()}report(t){se(t)||(this.problem=wt(t),this.changed())}clearProblem(){this.problem=void 0,this.changed()}async fill(t,r){let{step:n,draft:s}=this;await this.working(t,async i=>{let{session:a}=this;if(a!==void 0){let d=await a.holes(r,i),c=Vr(n.constraints,n.patches.map(l=>l.hole),d);await this.take(t,{choice:r,constraints:c},i),this.dispatchEvent(new Event("mended"))}}),(this.step!==n||s===void 0||!M(s))&&this.dropDraft()}async apply(t,r,n){let{step:s}=this;await this.working(t,async i=>{(r.selection!==void 0||r.holes.length+r.made.length>0)&&(await this.take(t,{choice:r,constraints:n},i),this.dispatchEvent(new Event("edited")))}),this.step!==s&&this.dropDraft()}async take(t,{choice:r,constraints:n},s){let{session:i}=this;if(i===void 0)return;let{patches:a,report:d}=await i.mend(r,n,s),{skipped:c,cutFaces:l}=i;this.skipped=c;let h=a.map(x=>x.hole.id??0),{made:u,acceptDoubtful:p,selection:f,more:v}=r,y={holes:h,made:u,acceptDoubtful:p,selection:f,more:v};this.history.push({label:t,...y,constraints:n,patches:a,cutFaces:l,report:d}),this.message=Kr(this.history.present)}travel(t,r){let n=this.step;this.work===void 0&&(t(),this.step!==n&&(this.message=`${r}. Now: ${this.step.label}.`,this.search.forget(),this.problem=void 0),this.dropDraft())}async working(t,r){this.work?.stop.abort();let n=new AbortController,s=(i,a)=>{n.signal.aborted||(this.work={label:i,share:a,stop:n},this.changed())};this.problem=void 0,s(t,void 0);try{await this.hand.settled(),await r({signal:n.signal,onSent:i=>s(i<1?t:"Computing",i<1?i:void 0),onWait:i=>s(`The service is busy; waiting ${i} s`,void 0)})}catch(i){this.report(i)}finally{this.work?.stop===n&&(this.work=void 0),this.changed()}}changed(){this.dispatchEvent(new Event("change"))}};var Ve=[["blended","Reconstruction blended","Like the cloth around it"],["marked","Reconstruction marked","Marked by glowing stripes"]],en="KHR_materials_variants";async function tn(o,e){if(!o.type.startsWith("model/gltf"))return o;let t=await o.arrayBuffer(),r=Oe(t)?Rt(t):new Uint8Array(t),n=JSON.parse(new TextDecoder().decode(r));if(!Go(n,e))return o;let[s,{type:i}]=[JSON.stringify(n),o];return Oe(t)?zo(s,t.slice(20+r.byteLength),i):new Blob([s],{type:i})}function Go(o,e){let t=Ve.find(([s])=>s===e)?.[1],r=o.extensions?.[en]?.variants?.findIndex(s=>s.name===t)??-1,n=!1;for(let s of o.meshes?.flatMap(({primitives:i=[]})=>i)??[]){let a=(s.extensions?.[en]?.mappings??[]).find(({variants:d=[]})=>d.includes(r))?.material;a!==void 0&&a!==s.material&&(s.material=a,n=!0)}return n}function zo(o,e,t){let r=new TextEncoder().encode(o),n=new Uint8Array((4-r.length%4)%4).fill(32),s=r.length+n.length,i=new DataView(new ArrayBuffer(20));return[1179937895,2,20+s+e.byteLength,s,1313821514].forEach((d,c)=>i.setUint32(4*c,d,!0)),new Blob([i,r,n,e],{type:t})}import{Box3 as ai,DirectionalLight as di,HemisphereLight as ci,Sphere as li,Vector3 as X}from"./vendor.js";import{Plane as os,Raycaster as ss,Vector2 as is,Vector3 as Nt}from"./vendor.js";import{DepthTexture as qo,Mesh as Ko,NearestFilter as rn,NoBlending as Jo,PlaneGeometry as Yo,SRGBColorSpace as Xo,ShaderMaterial as Qo,UnsignedIntType as Zo,Vector2 as es,WebGLRenderTarget as ts}from"./vendor.js";var on=0,T=1,nn=2,rs=`
varying vec2 place;
void main() {
  place = uv;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`,ns=`
uniform sampler2D colors;
uniform sampler2D depths;
varying vec2 place;
void main() {
  vec4 color = texture2D(colors, place);
  gl_FragColor = vec4(color.rgb / max(color.a, 1e-4), color.a);
  #include <colorspace_fragment>
  gl_FragColor.rgb *= color.a;
  gl_FragDepth = texture2D(depths, place).r;
}`,Ue=class{constructor(e){this.scene=e;let t=new Qo({uniforms:this.uniforms,vertexShader:rs,fragmentShader:ns,blending:Jo});this.picture=new Ko(new Yo(2,2),t),this.picture.layers.set(nn),this.picture.frustumCulled=!1,this.picture.renderOrder=-1,e.add(this.picture)}scene;target;isCurrent=!1;uniforms={colors:{value:null},depths:{value:null}};picture;forget(){this.isCurrent=!1}draw(e,t){let r=this.targetOf(e),n=this.isCurrent;return n||(t.layers.set(on),e.setRenderTarget(r),e.render(this.scene,t),e.setRenderTarget(null),this.isCurrent=!0),t.layers.set(T),t.layers.enable(nn),e.render(this.scene,t),Bt(t),n}dispose(){this.target?.dispose(),this.picture.geometry.dispose(),this.picture.material.dispose()}targetOf(e){let{x:t,y:r}=e.getDrawingBufferSize(new es);return this.target?.width===t&&this.target.height===r?this.target:(this.target?.dispose(),this.isCurrent=!1,this.target=new ts(t,r,{samples:4,colorSpace:Xo,minFilter:rn,magFilter:rn,depthTexture:new qo(t,r,Zo)}),this.uniforms.colors.value=this.target.texture,this.uniforms.depths.value=this.target.depthTexture,this.target)}};function Bt(o){o.layers.set(on),o.layers.enable(T)}var je=class{constructor(e,t){this.canvas=e;this.camera=t;this.raycaster.layers.enable(T)}canvas;camera;raycaster=new ss;at(e,t){let{left:r,top:n,width:s,height:i}=this.canvas.getBoundingClientRect(),a=new is((e-r)/s*2-1,1-(t-n)/i*2);return this.camera.updateMatrixWorld(),this.raycaster.setFromCamera(a,this.camera),this.raycaster}onScreenPlane(e,t,r){let{ray:n}=this.at(e,t),s=new os().setFromNormalAndCoplanarPoint(this.camera.getWorldDirection(new Nt),r);return n.intersectPlane(s,new Nt)??void 0}onLine(e,t,r,n){let{origin:s,direction:i}=this.at(e,t).ray,a=r.clone().sub(s),d=n.dot(i),c=(d*i.dot(a)-n.dot(a))/Math.max(1-d*d,1e-6);return r.clone().addScaledVector(n,c)}nearestOf(e,t,r){let{left:n,top:s,width:i,height:a}=this.canvas.getBoundingClientRect();this.camera.updateMatrixWorld();let d,c=new Nt;for(let l of e){c.copy(l).project(this.camera);let[h,u]=[n+(c.x+1)/2*i,s+(1-c.y)/2*a],p=Math.hypot(h-t.x,u-t.y);Math.abs(c.z)<=1&&p<=Math.min(r,d?.distance??r)&&(d={point:l,distance:p})}return d?.point}};function an(o,{from:e,to:t},r){let n;for(let p of o){let f=It(p),{at:v,distance:y}=sn(f,e);y<(n?.distance??Number.POSITIVE_INFINITY)&&(n={points:f,at:v,distance:y})}if(n===void 0)return[];let{points:s,at:i}=n,a=sn(s,t).at,d=s.length,c=p=>{let f=[s[i]];for(let v=i;v!==a;)v=(v+p+d)%d,f.push(s[v]);return f},[l,h]=[c(1),c(-1)],u=p=>r===void 0?ds(p):as(p,r);return u(l)<=u(h)?l:h}function It({points:o}){return Array.from({length:o.length/3},(e,t)=>[...o.subarray(3*t,3*t+3)])}function sn(o,e){let t={at:0,distance:Number.POSITIVE_INFINITY};return o.forEach((r,n)=>{let s=Ht(r,e);s<t.distance&&(t={at:n,distance:s})}),t}function as(o,{from:e,to:t}){let r=[0,1,2].map(i=>t[i]-e[i]),n=r[0]**2+r[1]**2+r[2]**2;return o.map(i=>{let a=r.reduce((c,l,h)=>c+l*(i[h]-e[h]),0),d=n>0?Math.min(Math.max(a/n,0),1):0;return Ht(i,e.map((c,l)=>c+d*r[l]))}).reduce((i,a)=>i+a,0)/o.length}function ds(o){return o.reduce((e,t,r)=>e+Ht(t,o[Math.max(r-1,0)]),0)}function Ht(o,e){return Math.hypot(o[0]-e[0],o[1]-e[1],o[2]-e[2])}function dn(o,e){let t=new Set(e),r=new Map;for(let n of o){let{centroid:s=[],length:i=0}=n,a;for(let d of t){let l=(Math.hypot(...d.centroid.map((h,u)=>h-(s[u]??0)))+Math.abs(d.length-i))/(i||1);l<(a?.cost??.05)&&(a={line:d,cost:l})}a!==void 0&&(t.delete(a.line),r.set(n.id??0,a.line))}return r}import{BufferAttribute as cs,BufferGeometry as ls,DoubleSide as cn,Group as hs,Line as ln,Line2 as yn,LineBasicMaterial as us,LineGeometry as ps,LineLoop as fs,LineMaterial as ms,Mesh as _e,MeshBasicMaterial as Vt,SphereGeometry as ys,Vector3 as Ut}from"./vendor.js";var gs=7,hn=64,We=750213,un=12723548,pn="cut",fn="twist",Ge=class{group=new hs;ball=new ys(1,24,16);ballMaterial=new Vt({color:We,depthTest:!1,transparent:!0});cutMaterial=new Vt({color:un,transparent:!0,opacity:.35,depthWrite:!1,side:cn});diskMaterial=new Vt({color:We,transparent:!0,opacity:.3,depthTest:!1,side:cn});lineMaterial=new us({color:We,depthTest:!1,transparent:!0});shown="{}";show(e){let t=JSON.stringify(e);return t===this.shown?!1:(this.clear(),this.shown=t,this.add(e),!0)}add({handles:e=[],tethers:t=[],ring:r=[],disk:n,ball:s,stretches:i=[],dashes:a=[]}){if(s!==void 0){let d=new _e(this.ball,this.cutMaterial);d.position.copy(s.center),d.scale.setScalar(s.radius),d.name=pn,this.group.add(d)}if(n!==void 0){let d=new _e(bs(n.center,n.ring),this.diskMaterial);d.name=fn,this.group.add(d)}for(let d of i.filter(c=>c.length>1))this.group.add(mn(d,{color:un,linewidth:6}));for(let d of a.filter(c=>c.length>1)){let c=d.reduce((h,u,p)=>h+u.distanceTo(d[Math.max(p-1,0)]??u),0),l={dashed:!0,dashSize:c/30,gapSize:c/40};this.group.add(mn(d,{color:We,linewidth:3,...l}))}for(let d of e){let c=new _e(this.ball,this.ballMaterial);c.position.copy(d),this.group.add(c)}for(let d of t)this.group.add(new ln(jt(d),this.lineMaterial));r.length>0&&this.group.add(new fs(jt(r),this.lineMaterial));for(let d of this.group.children)d.renderOrder=10,d.layers.set(T)}clear(){this.shown="{}";for(let e of this.group.children)e instanceof yn?(e.geometry.dispose(),e.material.dispose()):(e instanceof ln||e.name===fn)&&e.geometry.dispose();this.group.clear()}fit(e,t){let r=2*Math.tan(e.fov*Math.PI/360)/Math.max(t,1);for(let n of this.group.children)n instanceof _e&&n.geometry===this.ball&&n.name!==pn&&n.scale.setScalar(gs*r*e.position.distanceTo(n.position))}};function gn(o,e,t){let n=(Math.abs(e.x)<.9?new Ut(1,0,0):new Ut(0,1,0)).cross(e).normalize(),s=new Ut().crossVectors(e,n).normalize();return Array.from({length:hn},(i,a)=>{let d=2*Math.PI*a/hn;return o.clone().addScaledVector(n,t*Math.cos(d)).addScaledVector(s,t*Math.sin(d))})}function bs(o,e){let t=e.flatMap((r,n)=>[o,r,e[(n+1)%e.length]??r]);return jt(t)}function mn(o,e){let t=new ps;t.setPositions(o.flatMap(n=>n.toArray()));let r=new yn(t,new ms({depthTest:!1,transparent:!0,...e}));return r.computeLineDistances(),r}function jt(o){let e=new Float32Array(o.flatMap(t=>t.toArray()));return new ls().setAttribute("position",new cs(e,3))}import{BufferAttribute as Hn,Color as Gs,DoubleSide as jn,GLTFLoader as zs,Mesh as _n,MeshStandardMaterial as qt,Triangle as qs,Vector3 as Vn}from"./vendor.js";var vs=3.2*Math.PI;function wn(o,e,t){let r=o.length/3,n=new Float64Array(r),s=new Float64Array(r),i=new Float32Array(3*r),a=new Int32Array(r);bn(e,t,([u,p,f])=>{let v=xs(o,u,p,f),y=Math.hypot(...v);for(let[x,yr,gr]of[[u,p,f],[p,f,u],[f,u,p]]){n[x]=n[x]+Math.atan2(y,ks(o,x,yr,gr)),s[x]=s[x]+y/6,a[x]=a[x]+vn(yr)-vn(gr)|0;for(let te=0;te<3;te+=1)i[3*x+te]=i[3*x+te]+v[te]}});let d=n.map((u,p)=>a[p]!==0||u===0?(s[p]=0,0):u>vs?(s[p]=s[p]/2,2*Math.PI-u/2):2*Math.PI-u),c=new Float64Array(2*r);bn(e,t,([u,p,f])=>{let v=d[u]+d[p]+d[f],y=s[u]+s[p]+s[f];for(let x of[u,p,f])c[2*x]=c[2*x]+v,c[2*x+1]=c[2*x+1]+y});let l=new Float32Array(r),h=new Float32Array(r);for(let u=0;u<r;u+=1){let p=t[u],f=c[2*p+1];l[u]=f>0?c[2*p]/f:Number.NaN,h[u]=ws(i.subarray(3*p,3*p+3))}return{curvature:l,shade:h}}var _t=[.39,.49,.78];function ws([o=0,e=0,t=0]){let r=Math.hypot(o,e,t)||1;return Math.abs(o*_t[0]+e*_t[1]+t*_t[2])/r}function bn(o,e,t){let r=n=>e[o[n]];for(let n=0;n+2<o.length;n+=3){let[s,i,a]=[r(n),r(n+1),r(n+2)];s!==i&&i!==a&&a!==s&&t([s,i,a])}}function vn(o){let e=Math.imul(o+1,2654435761);return e^e>>>15}function xs(o,e,t,r){let n=(h,u)=>o[3*h+u]-o[3*e+u],[s,i,a,d,c,l]=[n(t,0),n(t,1),n(t,2),n(r,0),n(r,1),n(r,2)];return[i*l-a*c,a*d-s*l,s*c-i*d]}function ks(o,e,t,r){let n=(s,i)=>o[3*s+i]-o[3*e+i];return n(t,0)*n(r,0)+n(t,1)*n(r,1)+n(t,2)*n(r,2)}function xn({hole:o,positions:e}){let{patchDeviations:t=[]}=o,r=e.length/3;return t.length===r?new Float32Array(t):new Float32Array(r).fill(Number.NaN)}var ze=[[.02,.19,.38],[.13,.4,.67],[.57,.77,.87],[.97,.97,.97],[.99,.72,.39],[.88,.51,.08],[.5,.23,.03]],Pn=[[1,.97,.74],[1,.85,.4],[.98,.62,.2],[.85,.38,.08],[.58,.2,.04],[.3,.08,.03]],Ps={stretch:ze,curvature:ze,confidence:Pn},An=[.42,.44,.47],Sn=[.725,.745,.775],kn=.3,L=1024,As={stretch:Wt(ze),curvature:Wt(ze),confidence:Wt(Pn)},$n=Float32Array.from({length:L+1},(o,e)=>(1-kn+kn*e/L)**2.2);function qe(o,e,t){let r=new Float32Array(3*o.length),n=As[t.heat];for(let s=0;s<o.length;s+=1){let i=Ss(o[s],t),a=$n[Math.round(L*e[s])],d=Number.isFinite(i)?Math.round(L*Math.min(Math.max(i,0),1)):L+1;for(let c=0;c<3;c+=1)r[3*s+c]=n[3*d+c]*a}return r}function Ss(o,{heat:e,most:t}){switch(e){case"stretch":return(Math.log(o)/Math.log(1+t)+1)/2;case"curvature":return(o/t+1)/2;case"confidence":return o===0?0:o/t}}function Mn(o){let e=Sn.map(Dn),t=new Float32Array(3*o.length);for(let r=0;r<t.length;r+=1){let n=$n[Math.round(L*o[Math.floor(r/3)])];t[r]=e[r%3]*n}return t}function Gt(o){return`linear-gradient(to right, ${Ps[o].map(zt).join()})`}var Cn=zt(An),Tn=zt(Sn);function En(o,e){if(o==="confidence"){let s=e.flatMap(i=>[...i]).reduce((i,a)=>a>i?a:i,-1);return{heat:o,most:s<0?Number.NaN:s}}let t=[];for(let s of e){let i=Math.max(1,Math.floor(s.length/2e4));for(let a=0;a<s.length;a+=i){let d=s[a],c=o==="stretch"?Math.exp(Math.abs(Math.log(d)))-1:Math.abs(d);Number.isFinite(c)&&t.push(c)}}t.sort((s,i)=>s-i);let r=t[Math.floor(.95*t.length)]??0,n=o==="stretch"?.02:Number.MIN_VALUE;return{heat:o,most:$s(Math.max(r,n))}}function $s(o){let e=10**Math.floor(Math.log10(o)),t=[1,2,5,10].find(r=>r*e>=o*.9999)??10;return Number((t*e).toPrecision(1))}function zt(o){return`rgb(${o.map(e=>Math.round(255*e)).join()})`}function Wt(o){let e=Array.from({length:L+1},(t,r)=>Ms(o,r/L));return Float32Array.from([...e,An].flatMap(t=>t.map(Dn)))}function Ms(o,e){let t=e*(o.length-1),r=Math.min(Math.floor(t),o.length-2),[n,s]=[o[r],o[r+1]];return n.map((i,a)=>i+(s[a]-i)*(t-r))}function Dn(o){return o<=.04045?o/12.92:((o+.055)/1.055)**2.4}import{Box3 as Rs,BufferAttribute as Fn,DoubleSide as On,Mesh as Os,MeshBVH as Fs,MeshBasicMaterial as Bs,MeshStandardMaterial as Ns,Vector3 as ue,acceleratedRaycast as Is}from"./vendor.js";var Ke=class{constructor(e,t){this.slack=t;let r=s=>e[3*s],n=Array.from({length:e.length/3},(s,i)=>i).sort((s,i)=>r(s)-r(i));this.sorted=Float64Array.from(n.flatMap(s=>e.slice(3*s,3*s+3)))}slack;sorted;has(e,t,r){let{sorted:n,slack:s}=this,[i,a]=[0,n.length/3];for(;i<a;){let d=i+a>>1;n[3*d]<e-s?i=d+1:a=d}for(let d=3*i;d<n.length&&n[d]<=e+s;d+=3)if(Math.abs(n[d+1]-t)<=s&&Math.abs(n[d+2]-r)<=s)return!0;return!1}};function Ln(o,e,t){let r,n=(s,i)=>o[3*s+i];for(let s=0;s+2<e.length;s+=3){let[i,a,d]=[e[s],e[s+1],e[s+2]],c=l=>(n(i,l)+n(a,l)+n(d,l))/3;t.has(c(0),c(1),c(2))&&(r??=e.slice(),r.fill(e[s],s,s+3))}return r}var Ye=class{worker;waiting=new Map;nextId=0;async boundary(e){let t=await this.ask({...e,job:"boundary"});return"lines"in t?t.lines:Je(t)}async tree(e){let t=await this.ask({...e,job:"tree"});return"tree"in t?t.tree:Je(t)}async numbers(e){let t=await this.ask({...e,job:"numbers"});return"numbers"in t?t.numbers:Je(t)}async stretch(e,t){let r=await this.ask({...e,job:"stretch",cells:t});return"stretch"in r?r.stretch:Je(r)}stop(){this.worker?.terminate(),this.worker=void 0;for(let[e,t]of this.waiting)t({id:e,error:"stopped"});this.waiting.clear()}ask(e){this.worker??=this.start();let t=this.nextId;this.nextId+=1;let r=new Promise(n=>this.waiting.set(t,n));return this.worker.postMessage({...e,id:t},[e.positions.buffer,e.triangles.buffer]),r}start(){let e=new Worker(Cs(),{type:"module"});return e.onmessage=({data:t})=>{this.waiting.get(t.id)?.(t),this.waiting.delete(t.id)},e.onerror=()=>this.stop(),e}};function Cs(){let o=new URL("./worker.js",import.meta.url);if(o.origin===location.origin)return o;let e=`import ${JSON.stringify(o.href)};`;return URL.createObjectURL(new Blob([e],{type:"text/javascript"}))}function Je(o){throw new Error("error"in o?o.error:"the worker answered something else")}import{DRACOLoader as Ts,GLTFLoader as Es,MeshoptDecoder as Ds}from"./vendor.js";var Ls="KHR_draco_mesh_compression";async function Rn(o){let e=new Es().setMeshoptDecoder(Ds),{extensionsUsed:t=[]}=J(o);if(!t.includes(Ls))return(await e.parseAsync(o,"")).scene;let{DECODER:r}=await import("./draco.js"),[n,s]=[r.script,r.wasm].map(a=>URL.createObjectURL(new Blob([a]))),i=new Ts().setDecoderPath({js:n,wasm:s});try{return(await e.setDRACOLoader(i).parseAsync(o,"")).scene}finally{i.dispose(),URL.revokeObjectURL(n),URL.revokeObjectURL(s)}}function R(o){return o==="textured"||o==="shaded"||o==="wireframe"?void 0:o}var Hs=12172998;function Qe(o,e){return R(e)!==void 0?new Bs({vertexColors:!0,side:On}):new Ns({color:o,roughness:.85,side:On,wireframe:e==="wireframe"})}var Xe=class o{constructor(e){this.root=e;e.updateMatrixWorld(!0),this.bounds=new Rs().setFromObject(e),e.traverse(t=>{t instanceof Os&&(this.own.set(t,t.material),"isSkinnedMesh"in t||(t.raycast=Is))})}root;own=new Map;jobs=new Ye;bounds;plain;numbersAsked;ownColors=new Map;middles=[];lists=new Map;static async load(e){return new o(await Rn(e))}get meshes(){return[...this.own.keys()]}setShading(e){R(e)===void 0&&this.unpaint(),this.plain?.dispose();let t=e==="textured"?void 0:Qe(Hs,e);this.plain=t;for(let[r,n]of this.own)r.material=t??n}materialNear(e){let t,r=new ue;for(let[n,s]of this.own){let i=n.geometry.getAttribute("position");for(let a=0;a<i.count;a+=1){let d=r.fromBufferAttribute(i,a).applyMatrix4(n.matrixWorld).distanceToSquared(e);d<(t?.distance??Number.POSITIVE_INFINITY)&&(t={distance:d,material:Array.isArray(s)?s[0]:s})}}return t?.material}boundaryLines(){return this.jobs.boundary(this.wholeScene())}numbers(){return this.numbersAsked??=this.jobs.numbers(this.wholeScene()),this.numbersAsked}stretch(e){return this.jobs.stretch(this.wholeScene(),e)}paint(e){let t=0;for(let r of this.meshes){let{geometry:n}=r,s=t+3*n.getAttribute("position").count;this.ownColors.has(n)||this.ownColors.set(n,n.attributes.color),n.setAttribute("color",pe(e.slice(t,s))),t=s}}unpaint(){for(let[e,t]of this.ownColors)t===void 0?e.deleteAttribute("color"):e.setAttribute("color",t);this.ownColors.clear()}wholeScene(){return js(this.meshes.map(e=>this.whole(e,e.matrixWorld)))}async buildTrees(){for(let e of this.meshes){let t=await this.jobs.tree(this.whole(e,void 0));this.setCut(!1),e.geometry.boundsTree=Fs.deserialize(t,e.geometry),this.cutAgain()}}cutOut(e){e!==this.middles&&(this.middles=e,this.cutAgain())}setCut(e){for(let[t,{whole:r,cut:n}]of this.lists)t.geometry.setIndex(e?n:r)}whole(e,t){let r=this.lists.get(e);return Vs(e.geometry,r===void 0?e.geometry.index:r.whole,t)}cutAgain(){if(this.setCut(!1),this.lists.clear(),this.middles.length===0)return;let e=this.bounds.getSize(new ue).length()+this.bounds.getCenter(new ue).length(),t=new Ke(this.middles,1e-6*e);for(let r of this.meshes){let n=r.geometry.index,s=n===null?Bn(r.geometry.getAttribute("position").count):n.array,i=Ln(Us(r),new Uint32Array(s),t);i!==void 0&&this.lists.set(r,{whole:n,cut:new Fn(i,1)})}this.setCut(!0)}pick(e){return e.firstHitOnly=!0,e.intersectObjects(this.meshes,!1)[0]}dispose(){this.jobs.stop(),this.plain?.dispose();for(let[e,t]of this.own){e.geometry.dispose();for(let r of Array.isArray(t)?t:[t])_s(r)}}};function Vs(o,e,t){let r=o.getAttribute("position"),n=new Float32Array(3*r.count),s=new ue;for(let a=0;a<r.count;a+=1)s.fromBufferAttribute(r,a),t!==void 0&&s.applyMatrix4(t),s.toArray(n,3*a);let i=e===null?Bn(r.count):new Uint32Array(e.array);return{positions:n,triangles:i}}function Us({geometry:o,matrixWorld:e}){let t=o.getAttribute("position"),r=new Float64Array(3*t.count),n=new ue;for(let s=0;s<t.count;s+=1)n.fromBufferAttribute(t,s).applyMatrix4(e),r.set([n.x,n.y,n.z],3*s);return r}function Bn(o){let e=new Uint32Array(o);for(let t=0;t<o;t+=1)e[t]=t;return e}function js(o){let e=i=>i.reduce((a,d)=>a+d.length,0),t=new Float32Array(e(o.map(i=>i.positions))),r=new Uint32Array(e(o.map(i=>i.triangles))),[n,s]=[0,0];for(let i of o){t.set(i.positions,n);let a=n/3;r.set(i.triangles.map(d=>d+a),s),n+=i.positions.length,s+=i.triangles.length}return{positions:t,triangles:r}}function _s(o){for(let e of Object.values(o))typeof e=="object"&&e!==null&&"isTexture"in e&&e.dispose();o.dispose()}function pe(o){return new Fn(o,3)}function Nn(o){let e=[],t=[],r=0;for(let{hole:n}of o){let{gridPositions:s=[],knownCells:i=[],chartSide:a=0}=n,d=a/64,c=new Set(i),l=h=>s.slice(3*h,3*h+3);for(let h of d>0?i:[]){let u=h%64,f=[u>0?h-1:-1,u+1<64?h+1:-1,h-64,h+64].filter(v=>c.has(v)).map(v=>Ws(l(h),l(v)));f.length>0&&(e.push(...l(h)),t.push(f.reduce((v,y)=>v+y,0)/f.length/d),r=Math.max(r,1.2*d))}}return{positions:new Float32Array(e),stretch:new Float32Array(t),reach:r}}function In({hole:o,positions:e}){let{patchFaces:t=[],patchUvs:r=[],chartSide:n=0}=o,s=e.length/3,i=new Float32Array(2*s),a=(d,c,l,h)=>{let u=0;for(let p=0;p<c;p+=1)u+=(d[c*l+p]-d[c*h+p])**2;return Math.sqrt(u)};for(let d=0;d+2<t.length&&r.length>0;d+=3)for(let c=0;c<3;c+=1){let[l,h]=[t[d+c],t[d+(c+1)%3]],u=a(r,2,l,h)*n;if(u>0)for(let p of[l,h])i[2*p]=i[2*p]+a(e,3,l,h)/u,i[2*p+1]=i[2*p+1]+1}return Float32Array.from({length:s},(d,c)=>i[2*c]/i[2*c+1])}function Ws(o,e){return Math.hypot(...o.map((t,r)=>t-e[r]))}async function Wn(o){let{scene:e}=await new zs().parseAsync(o,"");e.updateMatrixWorld(!0);let t=[];return e.traverse(r=>{r instanceof _n&&t.push({geometry:r.geometry.applyMatrix4(r.matrixWorld),image:r.material.map})}),t}var Ze=class{constructor(e,{geometry:t,image:r},n){this.patch=e;this.image=r;let s=e.hole.id??0,i=e.dressing.positions.get(s)??e.positions,a=t.getAttribute("position");this.rim=(e.hole.rimPositions?.length??0)/3,this.corners=Ks(a.array,i),this.firstNormals=new Float32Array(t.getAttribute("normal").array);let d=Un(i,e.hole.patchFaces??[]);this.sides=Float32Array.from(this.corners,(c,l)=>[0,1,2].reduce((u,p)=>u+(d[3*c+p]??0)*(this.firstNormals[3*l+p]??0),0)<0?-1:1),this.ownColors=r===null?Ys(e,this.corners.length):void 0,t.setAttribute("position",pe(new Float32Array(3*this.corners.length))),t.setAttribute("normal",pe(new Float32Array(3*this.corners.length))),this.mesh=new _n(t,n),this.mesh.name=`hole ${s}`,this.unpaint(),this.update(e)}patch;mesh;image;corners;rim;firstNormals;ownColors;sides;get hole(){return this.patch.hole.id??0}get shown(){return this.patch}update(e){this.patch=e;let{geometry:t}=this.mesh,[r,n]=[t.getAttribute("position"),t.getAttribute("normal")],s=e.normals??Un(e.positions,e.hole.patchFaces??[]);for(let[i,a]of this.corners.entries()){let d=this.sides[i];for(let c=0;c<3;c+=1){let l=3*i+c;r.array[l]=e.positions[3*a+c],n.array[l]=a<this.rim?this.firstNormals[l]:d*s[3*a+c]}}r.needsUpdate=!0,n.needsUpdate=!0,t.computeBoundingSphere(),t.computeBoundingBox()}heatValues(e){switch(e){case"stretch":return In(this.patch);case"curvature":return this.numbers().curvature;case"confidence":return xn(this.patch)}}paint(e){let t=qe(this.heatValues(e.heat),this.numbers().shade,e),r=new Float32Array(3*this.corners.length);for(let[n,s]of this.corners.entries())r.set(t.subarray(3*s,3*s+3),3*n);this.mesh.geometry.setAttribute("color",pe(r))}unpaint(){let{geometry:e}=this.mesh;this.ownColors===void 0?e.deleteAttribute("color"):e.setAttribute("color",this.ownColors)}numbers(){let{positions:e,hole:t}=this.patch,r=Uint32Array.from({length:e.length/3},(n,s)=>s);return wn(e,t.patchFaces??[],r)}pointOf(e){if(e.face===null||e.face===void 0||!re(this.patch))return;let t=[e.face.a,e.face.b,e.face.c].map(c=>this.corners[c]),[r,n,s]=t.map(c=>this.vertex(c)),i=qs.getBarycoord(e.point,r,n,s,new Vn)?.toArray();if(i===void 0)return;let a=this.patch.hole.patchUvs??[],d=[0,1].map(c=>t.reduce((l,h,u)=>l+i[u]*a[2*h+c],0));return $(this.patch,d)}dispose(){this.image?.dispose(),this.mesh.geometry.dispose()}vertex(e){return new Vn().fromArray(this.patch.positions,3*e)}};function Ks(o,e){let t=(n,s)=>n.subarray(3*s,3*s+3).join(),r=new Map;for(let n=0;n<e.length/3;n+=1)r.set(t(e,n),n);return Uint32Array.from({length:o.length/3},(n,s)=>r.get(t(o,s))??Js(e,o.subarray(3*s,3*s+3)))}function Js(o,e){let t={vertex:0,distance:Number.POSITIVE_INFINITY};for(let r=0;r<o.length/3;r+=1){let n=[0,1,2].reduce((s,i)=>s+(o[3*r+i]-e[i])**2,0);n<t.distance&&(t={vertex:r,distance:n})}return t.vertex}function Ys({hole:o,dressing:e},t){let r=Float32Array.from(o.surface?.colors??[]),n=o.id??0;if(!(e.colours.has(n)||t===0||r.length!==4*t)){if(e.textures.get(n)?.method==="flat"){let s=[0,1,2,3].map(i=>r.reduce((a,d,c)=>c%4===i?a+d:a,0)/t);return new Hn(r.map((i,a)=>s[a%4]),4)}return new Hn(r,4)}}function Un(o,e){let t=new Float32Array(o.length),r=(n,s)=>o[3*n+s];for(let n=0;n+2<e.length;n+=3){let[s,i,a]=[e[n],e[n+1],e[n+2]],[d,c,l]=[r(i,0)-r(s,0),r(i,1)-r(s,1),r(i,2)-r(s,2)],[h,u,p]=[r(a,0)-r(s,0),r(a,1)-r(s,1),r(a,2)-r(s,2)];for(let f of[s,i,a])t[3*f]=t[3*f]+c*p-l*u,t[3*f+1]=t[3*f+1]+l*h-d*p,t[3*f+2]=t[3*f+2]+d*u-c*h}for(let n=0;n<t.length;n+=3){let s=t.subarray(n,n+3),i=Math.hypot(...s)||1;s.forEach((a,d)=>s[d]=a/i)}return t}var Gn=15770462;function zn({color:o,roughness:e,metalness:t}){return new qt({color:new Gs(...o),roughness:e,metalness:t,side:jn})}function qn(o,e){if(e!==null){let{roughness:t=.9,metalness:r=0}=o??{};return new qt({map:e,roughness:t,metalness:r,side:jn})}return o?.clone()??new qt({color:12172998})}import{Box3 as Xs,Group as Qs,Line2 as Zs,LineGeometry as ei,LineMaterial as ti,Vector3 as Kt}from"./vendor.js";var Jt={chosen:4,other:2},et=class{group=new Qs;lines=new Map;views=new Map;borders;constructor(e,t,r){this.borders=e.flatMap(n=>P(n)?[]:t.get(n.id??0)??[]);for(let n of e){let s=t.get(n.id??0);if(s===void 0)continue;let i=ne(n.kind??""),a=r*(i.line==="dotted"?.003:.012),d=new ti({color:i.color,linewidth:Jt.other,dashed:i.line!=="solid",dashSize:a,gapSize:i.line==="dotted"?2*a:.7*a}),c=new ei;c.setPositions([...s.points,...s.points.subarray(0,3)]);let l=new Zs(c,d);l.computeLineDistances(),this.lines.set(n.id??0,l),this.views.set(n.id??0,ri(s,n.kind)),this.group.add(l)}}choose(e){for(let[t,r]of this.lines)r.material.linewidth=e.has(t)?Jt.chosen:Jt.other}setVisible(e){this.group.visible=e}viewOf(e){return this.views.get(e)}dispose(){for(let e of this.lines.values())e.geometry.dispose(),e.material.dispose()}};function ri({points:o},e){let t=Array.from({length:o.length/3},(i,a)=>new Kt().fromArray(o,3*a)),r=new Xs().setFromPoints(t),n=r.getCenter(new Kt),s=new Kt;return t.forEach((i,a)=>{let d=t[(a+1)%t.length];s.add(i.clone().sub(n).cross(d.clone().sub(n)))}),{bounds:r,front:e==="HOLE"?s.negate().normalize():s.normalize()}}import{OrbitControls as ni,PerspectiveCamera as oi,Scene as si,Sphere as Kn,WebGLRenderer as ii}from"./vendor.js";var fe=class{constructor(e){this.ways=e}ways;chosen=0;times=[];get way(){return this.chosen}took(e){this.times=[...this.times,e].slice(-5);let t=this.times.toSorted((r,n)=>r-n)[4/2];this.times.length<5||t===void 0||(t>20&&this.chosen+1<this.ways?this.go(this.chosen+1):t<8&&this.chosen>0&&this.go(this.chosen-1))}go(e){this.chosen=e,this.times=[]}};var Zn=[1,.7,.5,.35],eo=[1,1,.7,.5,.35],Jn=250,Yn=2,tt=class{constructor(e,t){this.host=e;this.drawn=t;this.renderer=new ii({antialias:!0,alpha:!0}),this.renderer.setPixelRatio(Qn()),Bt(this.camera),this.canvas.tabIndex=0,e.append(this.canvas),this.controls=new ni(this.camera,this.canvas),this.controls.enableDamping=!1,this.controls.addEventListener("change",()=>this.draw()),this.resized=new ResizeObserver(()=>this.resize()),this.resized.observe(e),this.canvas.addEventListener("webglcontextrestored",()=>this.draw())}host;drawn;scene=new si;camera=new oi(35,1,.01,100);controls;renderer;stays=new Ue(this.scene);resized;paces=Xn();sphere;forgetFrame;change;finishedAt=Number.NEGATIVE_INFINITY;inFlight=0;isFull=!0;stillTimer;laterTimer;get canvas(){return this.renderer.domElement}get rendererName(){let e=this.renderer.getContext(),t=e.getExtension("WEBGL_debug_renderer_info");return String(e.getParameter(t?.UNMASKED_RENDERER_WEBGL??e.RENDERER))}get isStill(){return this.change===void 0&&this.inFlight===0&&this.isFull}draw(e="all"){if(this.change=this.change==="all"?"all":e,clearTimeout(this.laterTimer),this.laterTimer=void 0,this.forgetFrame===void 0)if(e==="cloth"&&this.paces.cloth.way>0){let t=setTimeout(this.drawAsked);this.forgetFrame=()=>clearTimeout(t)}else{let t=requestAnimationFrame(this.drawAsked);this.forgetFrame=()=>cancelAnimationFrame(t)}}drawAsked=()=>{this.forgetFrame=void 0,this.change!==void 0&&this.inFlight<(this.isSlow?1:2)&&this.drawFrame(this.change)};get isSlow(){return this.paces.camera.way+this.paces.cloth.way>0}drawMarks(e){e===0||this.paces.cloth.way===0||this.change!==void 0?this.draw("cloth"):this.laterTimer??=setTimeout(()=>this.draw("cloth"),e)}setBounds(e){this.sphere=e?.getBoundingSphere(new Kn),this.paces=Xn()}lookAt(e,t){let{center:r,radius:n}=e.getBoundingSphere(new Kn);if(e.isEmpty()||!(n>0))return;let s=Math.min(1,this.camera.aspect),i=1.1*n/Math.sin(this.camera.fov*Math.PI/360)/s,a=t.lengthSq()>0?t.clone():this.camera.position.clone().sub(this.controls.target);this.controls.target.copy(r),this.camera.position.copy(r).addScaledVector(a.normalize(),i),this.fitDepth(),this.controls.update(),this.draw()}pivotAt(e){this.controls.target.copy(e),this.controls.update(),this.draw()}async picture(){this.setShare(1),this.drawNow();let e=await new Promise(t=>this.canvas.toBlob(t,"image/png"));if(e===null)throw new Error("The browser made no picture.");return e}drawNow(){this.stays.forget(),this.fit();let{clientWidth:e,clientHeight:t}=this.host,{before:r,split:n}=this.drawn.look(),s=Math.round(n*e);this.renderer.setScissorTest(s>0),this.renderer.setScissor(s,0,e-s,t),this.drawPart(!r),s>0&&(this.renderer.setScissor(0,0,s,t),this.drawPart(!1))}dispose(){this.forgetFrame?.(),clearTimeout(this.stillTimer),clearTimeout(this.laterTimer),this.resized.disconnect(),this.controls.dispose(),this.stays.dispose(),this.renderer.dispose(),this.canvas.remove()}drawFrame(e){let t=this.inFlight>0||performance.now()-this.finishedAt<Jn;if(this.change=void 0,clearTimeout(this.stillTimer),!t){this.setShare(1),this.drawNow(),this.whenDrawn(()=>{});return}let{before:r,split:n}=this.drawn.look(),s=e==="cloth"&&n===0&&!r,i=s?this.paces.cloth:this.paces.camera;this.setShare((s?eo:Zn)[i.way]??1);let a=!0;s&&i.way>0?(this.fit(),this.renderer.setScissorTest(!1),a=this.stays.draw(this.renderer,this.camera),this.isFull=!1):this.drawNow(),this.whenDrawn(d=>a&&i.took(d))}drawStill(){this.change===void 0&&!this.isFull&&(this.finishedAt=Number.NEGATIVE_INFINITY,this.draw())}whenDrawn(e){let t=this.renderer.getContext(),r=performance.now(),n=t.fenceSync(t.SYNC_GPU_COMMANDS_COMPLETE,0);t.flush(),this.inFlight+=1;let s=()=>{if(n!==null&&t.clientWaitSync(n,0,0)===t.TIMEOUT_EXPIRED){setTimeout(s,Yn);return}t.deleteSync(n),this.inFlight-=1,this.finishedAt=performance.now(),e(this.finishedAt-r),this.change!==void 0?this.draw(this.change):this.isFull||(clearTimeout(this.stillTimer),this.stillTimer=setTimeout(()=>this.drawStill(),Jn))};setTimeout(s,Yn)}setShare(e){let t=e*Qn();this.isFull=e===1,this.renderer.getPixelRatio()!==t&&this.renderer.setPixelRatio(t)}fit(){this.fitDepth(),this.drawn.fit(this.host.clientHeight)}drawPart(e){this.drawn.arrange(e),this.renderer.render(this.scene,this.camera),this.drawn.arrange(!0)}fitDepth(){if(this.sphere!==void 0){let{center:e,radius:t}=this.sphere,r=this.camera.position.distanceTo(e);this.camera.far=r+4*t,this.camera.near=Math.max(r-4*t,this.camera.far/5e3),this.camera.updateProjectionMatrix()}}resize(){let{clientWidth:e,clientHeight:t}=this.host;e>0&&t>0&&(this.renderer.setSize(e,t),this.camera.aspect=e/t,this.camera.updateProjectionMatrix(),this.setShare(1),this.drawNow())}};function Xn(){return{camera:new fe(Zn.length),cloth:new fe(eo.length)}}function Qn(){return Math.min(devicePixelRatio,2)}var Yt={shading:"textured",tinted:!0,outlined:!0,before:!1,split:0},rt=class{marks=new Ge;aim;screen;scan;rims;patches=[];heat;stretch;onHeat=()=>{};onError=()=>{};wanted=[];look=Yt;chosen;cutFaces=[];constructor(e){this.screen=new tt(e,{look:()=>this.look,arrange:i=>{this.patches.forEach(({mesh:a})=>a.visible=i),this.scan?.setCut(i)},fit:i=>this.marks.fit(r,i)});let{scene:t,camera:r}=this.screen;this.aim=new je(this.canvas,r);let n=new di(16777215,1.9);n.position.set(1,1.2,.9),r.add(n);let s=new ci(16777215,9279397,1);for(let i of[n,s])i.layers.enable(T);t.add(r,s,this.marks.group)}get canvas(){return this.screen.canvas}get camera(){return this.screen.camera}get controls(){return this.screen.controls}get rendererName(){return this.screen.rendererName}get isStill(){return this.screen.isStill}async showScan(e,t){let r=await Xe.load(e.slice(0));this.clear(),this.scan=r,this.screen.scene.add(r.root),this.screen.setBounds(r.bounds),r.setShading(this.shading),this.renewHeat();let n=r.bounds.getBoundingSphere(new li);this.screen.lookAt(r.bounds,new X(.5,.5,1));let s=await r.boundaryLines();if(this.scan!==r)return;this.rims=new et(t,dn(t,s),n.radius||1),this.rims.setVisible(this.look.outlined),this.rims.choose(this.chosen??new Set),this.screen.scene.add(this.rims.group);let i=z(t)[0]?.[1][0]?.id??0;this.screen.lookAt(r.bounds,this.rims.viewOf(i)?.front??new X(.5,.5,1)),r.buildTrees().catch(()=>{})}chooseLoops(e){e!==this.chosen&&(this.chosen=e,this.rims?.choose(e),this.draw())}async showPatches(e){this.wanted=e;let t=e[0]?.dressing;if(!this.showsSurfacesOf(e)){let n=t===void 0?[]:await Wn(t.glb.slice(0));if(this.wanted[0]?.dressing!==t)return;this.showsSurfacesOf(this.wanted)||(this.replacePatches(n),this.renewHeat(),this.draw())}this.wanted.filter((n,s)=>this.move(n,this.patches[s])).length>0&&this.screen.draw("cloth")}move(e,t){return t===void 0||t.shown===e?!1:(t.update(e),this.heat!==void 0&&t.paint(this.heat),!0)}mark(e,t){this.marks.show(e)&&this.screen.drawMarks(t)}showCut(e){e!==this.cutFaces&&(this.cutFaces=e,this.scan?.cutOut(e),this.draw())}nearestOfBorder(e,t){let r=this.rims?.borders??[];return this.aim.nearestOf(r.flatMap(It).map(n=>new X(...n)),{x:e,y:t},40)}stretchBetween(e,t){return an(this.rims?.borders??[],e,t).map(n=>new X(...n))}setLook(e){let t=this.look;this.look={...t,...e},this.rims?.setVisible(this.look.outlined),t.shading!==this.look.shading&&this.renewHeat(),(t.shading!==this.look.shading||t.tinted!==this.look.tinted)&&this.renewMaterials(),this.draw()}renewMaterials(){this.scan?.setShading(this.shading);for(let e of this.patches)e.mesh.material.dispose(),e.mesh.material=this.materialOf(e.shown,e.image),R(this.shading)===void 0&&e.unpaint()}get shading(){let{shading:e}=this.look;return R(e)===void 0||this.heat?.heat===e?e:"shaded"}renewHeat(){let{scan:e}=this;this.showHeat().catch(t=>{this.scan===e&&this.onError(t)})}async showHeat(){let{scan:e,look:t,patches:r}=this,n=R(t.shading);if(n===void 0||e===void 0){this.heat=void 0,this.onHeat(n,void 0);return}this.onHeat(n,this.heat?.heat===n?this.heat:void 0);let[{shade:s},i]=await Promise.all([e.numbers(),this.heatOfScan(n,e)]);if(this.scan!==e||R(this.look.shading)!==n||this.patches!==r)return;let a=r.map(d=>d.heatValues(n));this.heat=En(n,i===void 0?a:[i,...a]),e.paint(i===void 0?Mn(s):qe(i,s,this.heat));for(let d of r)d.paint(this.heat);this.renewMaterials(),this.onHeat(n,this.heat),this.draw()}async heatOfScan(e,t){if(e==="confidence")return;if(e==="curvature")return(await t.numbers()).curvature;let r=this.wanted[0]?.dressing;return(this.stretch===void 0||this.stretch.dressing!==r)&&(this.stretch={dressing:r,values:t.stretch(Nn(this.wanted))}),this.stretch.values}frame(e){let t=e===void 0?void 0:this.rims?.viewOf(e);this.screen.lookAt(t?.bounds??this.scan?.bounds??new ai,t?.front??new X)}pivotAt(e){this.screen.pivotAt(e)}pick(e,t){let r=this.aim.at(e,t),n=this.look.before?[]:this.patches,s=r.intersectObjects(n.map(({mesh:a})=>a),!1)[0],i=this.scan?.pick(r);if(s!==void 0&&s.distance<=(i?.distance??Number.POSITIVE_INFINITY)){let a=this.patches.find(({mesh:d})=>d===s.object);return{position:s.point,cloth:a?.pointOf(s),onPatch:!0}}return i&&{position:i.point,cloth:void 0,onPatch:!1}}draw(){this.screen.draw()}picture(){return this.screen.picture()}dispose(){this.clear(),this.screen.dispose()}materialOf({hole:e,dressing:t},r){let{shading:n}=this,{tinted:s}=this.look;if(s&&R(n)===void 0)return Qe(Gn,n);if(n!=="textured")return Qe(12172998,n);let i=t.colours.get(e.id??0);if(i!==void 0)return zn(i);let a=this.scan?.materialNear(new X().fromArray(e.rimPositions??[0,0,0]));return qn(a,r)}clear(){this.clearPatches(),this.marks.clear(),this.scan!==void 0&&(this.screen.scene.remove(this.scan.root),this.scan.dispose()),this.rims!==void 0&&(this.screen.scene.remove(this.rims.group),this.rims.dispose()),this.scan=void 0,this.heat=void 0,this.stretch=void 0,this.rims=void 0,this.cutFaces=[]}showsSurfacesOf(e){let t=(r,n)=>this.patches[n]?.shown.dressing===r.dressing;return e.length===this.patches.length&&e.every(t)}replacePatches(e){this.clearPatches(),this.wanted.forEach((t,r)=>{let n=e[r];if(n!==void 0){let s=new Ze(t,n,this.materialOf(t,n.image));this.heat!==void 0&&s.paint(this.heat),this.patches.push(s),s.mesh.layers.set(T),this.screen.scene.add(s.mesh)}})}clearPatches(){for(let e of this.patches)this.screen.scene.remove(e.mesh),e.mesh.material.dispose(),e.dispose();this.patches=[]}};import{LitElement as aa,css as da,html as ee,nothing as fr}from"./vendor.js";function V(o,e){let t=document.createElement("a");t.href=URL.createObjectURL(o),t.download=e,t.click(),setTimeout(()=>URL.revokeObjectURL(t.href),6e4)}import{css as yi,html as me,nothing as C,svg as ye}from"./vendor.js";import{svg as hi}from"./vendor.js";var Xt=64,nt=[[253,231,37],[53,183,121],[49,104,142],[68,1,84]];function to(o){let e=o.filter(t=>t!==null&&Number.isFinite(t));return e.length===0?void 0:{least:e.reduce((t,r)=>Math.min(t,r)),most:e.reduce((t,r)=>Math.max(t,r))}}function ro(o,{least:e,most:t},r){let n=r/Xt,s=Math.max(t*1e-6,Number.MIN_VALUE),i=c=>Math.log(c+s),[a,d]=[i(e),i(t)];return o.flatMap((c,l)=>{if(c===null||!Number.isFinite(c))return[];let[h,u]=[l%Xt,Math.floor(l/Xt)],p=ui(d>a?(i(c)-a)/(d-a):0);return[hi`<rect x=${h*n} y=${r-(u+1)*n} width=${n} height=${n} shape-rendering="crispEdges" fill=${p} />`]})}function ui(o){let e=Math.min(Math.max(o,0),1)*(nt.length-1),t=Math.min(Math.floor(e),nt.length-2),[r,n]=[nt[t],nt[t+1]];return`rgb(${r.map((i,a)=>Math.round(i+(n[a]-i)*(e-t))).join()})`}import{LitElement as fi,css as mi}from"./vendor.js";import{css as pi}from"./vendor.js";var Q=pi`
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
`;var m=class extends fi{static styles=[Q,mi`
      fieldset {
        margin: 0 0 0.5rem;
        padding: 0;
        border: 0;
      }
      .choice {
        display: flex;
        align-items: center;
        gap: 4px;
        min-height: 28px;
      }
    `];editor;changed=()=>this.requestUpdate();connectedCallback(){super.connectedCallback(),this.editor.addEventListener("change",this.changed)}disconnectedCallback(){super.disconnectedCallback(),this.editor.removeEventListener("change",this.changed)}};var U=256,ot=64,no={whole:1/ot,fine:1/(4*ot)},gi=new Map([["ArrowLeft",[-1,0]],["ArrowRight",[1,0]],["ArrowDown",[0,-1]],["ArrowUp",[0,1]]]),Qt=class extends m{static styles=[m.styles,yi`
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
    `].flat();held;render(){let{draft:e,found:t,editable:r}=this.editor,s=(e===void 0||M(e)?void 0:e.hole)??t?.hole??r[0]?.hole.id,i=r.find(f=>f.hole.id===s);if(i===void 0||s===void 0)return C;let a=t!==void 0&&t.hole===s?t.found:void 0,d=i.hole.chartPng,c=this.editor.tool==="anchor"&&this.editor.map?.hole===s?this.editor.map.losses:[],l=to(c),h=(a?.path??[]).map(({cell:f})=>wi(f??[])),[u,p]=[this.dots(s),this.gestures(s)];return me`
      <h2>Chart of hole ${s}</h2>
      <svg viewBox="0 0 ${U} ${U}" role="group" aria-label=${this.words(s)}>
        ${d?ye`<image href="data:image/png;base64,${d}" width=${U} height=${U} />`:C}
        ${l?ro(c,l,U):C}
        ${h.length>1?ye`<polyline points=${h.map(f=>st(f).join()).join(" ")} fill="none" stroke="#0b7285" stroke-width="2" />`:C}
        ${p.map(f=>oo(f,"#ffffff"))}
        ${e?xi(e).map(f=>oo(f,"#22b8cf")):C}
        ${a?.uv?vi(a.uv):C} ${u.map(f=>this.anchorDot(f,i))}
      </svg>
      ${a!==void 0||u.length+p.length>0?me`<p class="quiet small">White: gestures; yellow: anchors; the cross: where the last search ended.</p>`:C}
      ${u.length>0?me`<p class="quiet small">
              Drag a dot to choose which place of the cloth goes to its point; the arrow keys move it, too, Enter keeps
              it.
            </p>`:C}
      ${l?me`<p class="small">
              The map: light where the loss is least (${g(l.least)}), dark where it is largest
              (${g(l.most)}).
            </p>`:C}
      ${a?me`<p class="small">
              The point belongs at u ${a.uv?.[0]?.toFixed(3)}, v ${a.uv?.[1]?.toFixed(3)}; the search went
              through ${h.length} ${h.length===1?"cell":"cells"}.
            </p>`:C}
    `}dots(e){let{draft:t,found:r,step:n}=this.editor,s=t?.kind==="anchor"&&t.hole===e?t:void 0,i=n.constraints.anchors.flatMap((d,c)=>{let l=s?.replaces===c?s:void 0,h=l?.uv??d.uv;return(d.hole===void 0||d.hole===e)&&h?.length===2?[bi(d,{index:c,hole:e,uv:h,draft:l})]:[]}),a=s?.uv??(r?.hole===e?r.found.uv:void 0);return s===void 0||s.replaces!==void 0||a===void 0?i:[...i,{name:"New anchor",uv:a,at:d=>({...s,uv:d})}]}anchorDot(e,t){let[r,n]=st(e.uv),[s,i]=e.uv,a=`u ${s.toFixed(3)}, v ${i.toFixed(3)}`;return ye`
      <g
        class="dot"
        role="slider"
        tabindex="0"
        aria-label="${e.name} on the chart"
        aria-valuemin="0"
        aria-valuemax="1"
        aria-valuenow=${s.toFixed(3)}
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
    `}down(e,{uv:t}){e.button!==0||!e.isPrimary||this.editor.work!==void 0||(e.currentTarget.setPointerCapture(e.pointerId),this.held={pointer:e.pointerId,x:e.clientX,y:e.clientY,uv:t,moved:!1})}move(e,t,r){let n=this.renderRoot.querySelector("svg")?.getBoundingClientRect();if(this.held?.pointer!==e.pointerId||n===void 0)return;this.held.moved=!0;let{x:s,y:i,uv:a}=this.held;this.put(t,[a[0]+(e.clientX-s)/n.width,a[1]-(e.clientY-i)/n.height],r)}up=e=>{let{held:t}=this;this.held=void 0,t?.pointer===e.pointerId&&t.moved&&this.editor.draft?.kind==="anchor"&&this.editor.commit()};cancel=()=>{this.held=void 0,this.editor.dropDraft()};key(e,t,r){let n=gi.get(e.key),{draft:s,work:i}=this.editor;if(i===void 0)if(n!==void 0){e.preventDefault();let a=e.shiftKey?no.fine:no.whole;this.put(t,[t.uv[0]+a*n[0],t.uv[1]+a*n[1]],r)}else e.key==="Enter"&&s?.kind==="anchor"&&s.uv!==void 0?(e.preventDefault(),this.editor.commit()):e.key==="Escape"&&this.cancel()}put(e,t,r){if($(r,t)===void 0)return;let n=e.at(t);this.editor.tool!=="anchor"&&this.editor.setTool("anchor"),this.editor.preview(n)}gestures(e){let t=n=>n.hole===void 0||n.hole===e;return this.editor.step.constraints.edits.filter(t).flatMap(({grab:n,twist:s,pinch:i})=>[n?.uv,s?.uv,...i?.uvs??[]]).filter(n=>n?.length===2)}words(e){let t=this.gestures(e).length+this.dots(e).length;return`The cloth around hole ${e}, laid flat, with ${t} ${t===1?"place":"places"} of constraints.`}};function bi({position:o,hard:e=!1},{index:t,hole:r,uv:n,draft:s}){let[i=0,a=0,d=0]=o??[],c=s??{kind:"anchor",hole:r,position:[i,a,d],hard:e,replaces:t};return{name:`Anchor ${t+1}`,uv:n,at:l=>({...c,uv:l})}}function st([o,e]){return[o*U,(1-e)*U]}function oo(o,e){let[t,r]=st(o);return ye`<circle cx=${t} cy=${r} r="5" fill=${e} stroke="#1c2026" stroke-width="1.5" />`}function vi(o){let[e,t]=st(o),r=`M${e-8},${t}H${e+8}M${e},${t-8}V${t+8}`;return ye`<path d=${r} stroke="#1c2026" stroke-width="4" /><path d=${r} stroke="#ffd43b" stroke-width="2" />`}function wi([o=0,e=0]){return[(o+.5)/ot,(e+.5)/ot]}function xi(o){switch(o.kind){case"grab":case"twist":return[o.uv];case"pinch":return o.uvs;case"anchor":case"cut":case"polygon":case"border":return[]}}customElements.define("darn-chart",Qt);import{html as ki}from"./vendor.js";var Zt=class extends m{render(){let{work:e}=this.editor,t=e!==void 0;return ki`
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
`],{type:"application/json"});V(e,`${Y(this.editor.scan?.name)}.constraints.json`)};pick=()=>this.renderRoot.querySelector("input[type=file]")?.click();picked=async e=>{let t=e.target,r=await t.files?.[0]?.text();t.value="",r!==void 0&&await this.editor.loadConstraints(r)}};customElements.define("darn-constraints",Zt);import{css as Mi,html as k,nothing as j,svg as Ci}from"./vendor.js";import{css as Pi,html as er,nothing as Ai}from"./vendor.js";var tr=class extends m{static styles=[m.styles,Pi`
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
    `].flat();render(){let{editor:e}=this,{step:t,alternative:r,canVary:n}=e,s=Tt(t.constraints.alternative,t.report),i=(a,d,c)=>er`
      <button
        aria-label=${d}
        ?disabled=${!n}
        aria-disabled=${c<0||c>=8}
        @click=${()=>{e.chooseFill(c)}}
      >
        ${a}
      </button>
    `;return er`
      <div class="row" role="group" aria-label="Fills">
        ${i("\u2039","Previous fill",r-1)}
        <span class=${n?"":"quiet"}>${D(r)}</span>
        ${i("\u203A","Next fill",r+1)}
      </div>
      ${s===void 0?Ai:er`<p class="small">${s}</p>`}
    `}};customElements.define("darn-fill",tr);import{css as Si,html as rr,nothing as $i}from"./vendor.js";var nr=class extends m{static styles=[m.styles,Si`
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
    `].flat();render(){let{canVary:e,texture:t,scan:r}=this.editor,n=r!==void 0&&Fe(r.document),s=[[void 0,Et],...q];return rr`
      <label>
        Colour of the new cloth
        <select ?disabled=${!e||!n} @change=${this.choose}>
          ${s.map(([i,a])=>rr` <option value=${i??""} .selected=${i===t}>${a}</option> `)}
        </select>
      </label>
      ${n?$i:rr`<p class="quiet small">
              This scan has neither images nor colours of vertices: the new cloth has its material.
            </p>`}
    `}choose=e=>{let{value:t}=e.target;this.dispatchEvent(new CustomEvent("darn-look",{detail:{tinted:!1},bubbles:!0,composed:!0})),this.editor.vary({texture:t===""?void 0:t})}};customElements.define("darn-texture",nr);var Ti=new Set(["not_selected","excepted","outer_boundary","tube_end","opening"]),or=class extends m{static styles=[m.styles,Mi`
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
    `].flat();lastClicked;render(){let{scan:e,chosen:t,work:r,step:n}=this.editor,s=e?.loops??[],i=s.filter(P).map(a=>a.id??0);return k`
      <h2>Holes</h2>
      ${z(s).map(([a,d])=>this.group(a,d))}
      ${i.length===0?k`<p>This scan has no holes to fill.</p>`:j} ${this.candidates()} ${this.made()}
      ${this.doubtful()}
      <div class="row">
        <button
          class=${this.isNew?"main":""}
          id="mend"
          ?disabled=${t.size===0||r!==void 0}
          @click=${this.mend}
        >
          Mend ${t.size===1?"1 hole":`${t.size} holes`}
        </button>
        <button ?disabled=${i.length===0} @click=${()=>this.editor.choose(new Set(i))}>All</button>
        <button ?disabled=${t.size===0} @click=${()=>this.editor.choose(new Set)}>None</button>
      </div>
      ${n.patches.length===0?j:k`<darn-fill .editor=${this.editor}></darn-fill> <darn-texture .editor=${this.editor}></darn-texture>`}
    `}get isNew(){let{chosen:e,step:t,scan:r,acceptDoubtful:n}=this.editor,s=t.holes.filter(a=>r?.loops.some(d=>d.id===a));return!(e.size===s.length&&s.every(a=>e.has(a)))||n!==t.acceptDoubtful}doubtful(){let{skipped:e,acceptDoubtful:t}=this.editor;return!t&&!e.some(({code:n})=>n==="no_plausible_fill")?j:k`
      <label class="doubtful">
        <input type="checkbox" .checked=${t} @change=${n=>this.editor.setAcceptDoubtful(n.target.checked)} />
        Mend with doubtful cloth, too
      </label>
    `}candidates(){let e=this.editor.scan?.candidates??[];if(e.length===0)return j;let t=r=>{this.editor.setTool("border"),this.editor.preview(yt(r))};return k`
      <h3>Bites, rips and tears at the border (${e.length})</h3>
      <ul aria-label="Bites, rips and tears at the border">
        ${e.map((r,n)=>{let s=r.border?.facing!==void 0,i=s?`${g(r.length)} long`:`${g(r.depth)} deep`;return k`
            <li class="other">
              <button @click=${()=>t(r)}>${s?"Tear":"Bite or rip"} ${n+1}</button>
              <span class="quiet small">${g(r.mouth)} wide · ${i}</span>
            </li>
          `})}
      </ul>
    `}made(){let{step:e,work:t}=this.editor;return e.made.length===0?j:k`
      <h3>Cut out and borders (${e.made.length})</h3>
      <ul aria-label="Cut out and borders">
        ${e.made.map((r,n)=>k`
            <li class="other">
              <span class="name">${so(r)} ✓ mended</span>
              <button
                class="back"
                ?disabled=${t!==void 0}
                aria-label="Put back ${n+1}: ${so(r)}"
                @click=${()=>{this.editor.unmake(r)}}
              >
                Put back
              </button>
            </li>
          `)}
      </ul>
    `}group(e,t){let r=ne(e),n={solid:"",dashed:"7 4",dotted:"2 4"}[r.line],s=Ci`<svg width="30" height="8" aria-hidden="true">
      <line x1="0" y1="4" x2="30" y2="4" stroke=${r.color} stroke-width="3" stroke-dasharray=${n} />
    </svg>`;return k`
      <h3>${s}${r.plural} (${t.length})</h3>
      <ul aria-label=${r.plural}>
        ${t.map(i=>this.item(i,t))}
      </ul>
    `}item(e,t){let r=e.id??0,{step:n,skipped:s,chosen:i}=this.editor,a=n.holes.includes(r),d=s.find(l=>l.id===r&&!Ti.has(l.code??"")),c=`${ne(e.kind??"").singular} ${r}`;return k`
      <li>
        ${wr(e)?k`<input
                type="checkbox"
                aria-label="Choose ${c}"
                .checked=${i.has(r)}
                @click=${l=>this.toggle(l,r,t)}
              />`:k`<span></span>`}
        <button @click=${()=>this.frame(r)} aria-label="Show ${c}, length ${g(e.length)}">
          ${c}${a?" \u2713 mended":""}
        </button>
        <span class="quiet small">${g(e.length)} long · ${e.vertices} vertices</span>
        ${Ei(e)} ${d?k`<span class="why quiet small">Left open: ${d.reason}.</span>`:j}
      </li>
    `}toggle(e,t,r){let n=r.map(l=>l.id??0),s=new Set(this.editor.chosen),[i,a]=[n.indexOf(this.lastClicked??t),n.indexOf(t)],d=e.shiftKey&&i>=0?n.slice(Math.min(i,a),Math.max(i,a)+1):[t],c=e.target.checked;for(let l of d)c?s.add(l):s.delete(l);this.lastClicked=t,this.editor.choose(s)}frame(e){this.dispatchEvent(new CustomEvent("darn-frame",{detail:e,bubbles:!0,composed:!0}))}mend=()=>{this.editor.mend()}};function so(o){if("border"in o){let n=o.border.facing?"Tear":"Part of the border";return o.border.auto?"All bites and rips":n}let{radius:e,loops:t,polygon:r}=o.cut;return e!==void 0?`Ball of radius ${g(e)}`:r!==void 0?`Polygon of ${r.length} corners`:`Edge of ${(t??[]).map(n=>`hole ${n}`).join(", ")}`}function Ei({confidence:o=0,evidence:e=[]}){if(e.length===0)return j;let t=[...e].sort((r,n)=>Math.abs(n.weight??0)-Math.abs(r.weight??0));return k`
    <details class="why quiet small">
      <summary>${Math.round(o*100)} % sure</summary>
      ${t.map(({reason:r})=>k`<p>${r}</p>`)}
    </details>
  `}customElements.define("darn-holes",or);import{LitElement as Di,css as Li,html as Ri}from"./vendor.js";var it=class{name;constructor(e){this.name=`darn key ${e.href}`}get kept(){try{return sessionStorage.getItem(this.name)??void 0}catch{return}}keep(e){try{e===void 0?sessionStorage.removeItem(this.name):sessionStorage.setItem(this.name,e)}catch{}}},sr=class extends Di{static styles=[Q,Li`
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
    `];answer;ask(){return this.settle(void 0),this.field.value="",this.dialog.showModal(),new Promise(e=>this.answer=e)}render(){return Ri`
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
    `}get dialog(){return this.renderRoot.querySelector("dialog")}get field(){return this.renderRoot.querySelector("input")}submit=e=>{e.preventDefault(),this.settle(this.field.value.trim())};settle(e){let{answer:t}=this;this.answer=void 0,this.field.value="",this.dialog.close(),t?.(e)}};customElements.define("darn-key",sr);import{html as ir}from"./vendor.js";var Oi=[["textured","Textured"],["shaded","Shaded"],["wireframe","Wireframe"],["stretch","Stretch"],["curvature","Curvature"],["confidence","Confidence"]],ar=class extends m{static properties={shown:{}};render(){return ir`
      <h2>Look</h2>
      <fieldset>
        <legend class="quiet small">Surface</legend>
        <div class="row">
          ${Oi.map(([e,t])=>ir`
              <label class="choice">
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
      <label>
        Before and after (hold B for before)
        <input
          type="range"
          min="0"
          max="1"
          step="0.01"
          .value=${String(this.shown.split)}
          @input=${e=>this.look({split:Number(e.target.value)})}
        />
      </label>
    `}check(e,t){let r=n=>this.look({[t]:n.target.checked});return ir`<label class="choice"
      ><input type="checkbox" .checked=${this.shown[t]} @change=${r} />${e}</label
    >`}look(e){this.dispatchEvent(new CustomEvent("darn-look",{detail:e,bubbles:!0,composed:!0}))}};customElements.define("darn-look",ar);import{css as Fi,html as Z,nothing as Bi}from"./vendor.js";var dr=class extends m{static styles=[m.styles,Fi`
      .hole {
        margin-bottom: 0.75rem;
      }
      .hole p {
        margin: 0;
      }
    `].flat();render(){let{report:e}=this.editor.step,t=[...this.editor.scan?.notes??[],...e?.notes??[]];return e===void 0?t.length===0?Bi:Z`<h2>Notes</h2>
            ${t.map(r=>Z`<p>${r}</p>`)}`:Z`
      <h2>Report</h2>
      <p>${qr(e)}</p>
      ${[...new Set(t)].map(r=>Z`<p>${r}</p>`)}
      ${(e.holes??[]).map(r=>Z`<div class="hole">${zr(r).map(n=>Z`<p>${n}</p>`)}</div>`)}
      <button
        @click=${()=>V(new Blob([JSON.stringify(e,void 0,2)]),`${Y(this.editor.scan?.name)}.report.json`)}
      >
        Save the report
      </button>
    `}};customElements.define("darn-report",dr);import{html as at,nothing as Ni}from"./vendor.js";var cr=class extends m{static properties={look:{}};render(){return at`
      <h2>Save</h2>
      ${this.editor.step.holes.length>0?this.looks():Ni}
      <button @click=${()=>this.tell("darn-picture")}>Save a picture</button>
    `}looks(){return at`
      <fieldset>
        <legend class="quiet small">New cloth in the saved scan</legend>
        ${Ve.map(([e,,t])=>at`
            <label class="choice">
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
          ${Ve.map(([,e],t)=>at`${t>0?" and ":""}“${e}”`)}.
        </p>
      </fieldset>
    `}tell(e,t){this.dispatchEvent(new CustomEvent(e,{detail:t,bubbles:!0,composed:!0}))}};customElements.define("darn-save",cr);var O={turn:Math.PI/36,move:24,zoom:.9},Ii=new Map([["ArrowLeft",[1,0]],["ArrowRight",[-1,0]],["ArrowUp",[0,1]],["ArrowDown",[0,-1]]]),Hi=new Map([["+",O.zoom],["=",O.zoom],["-",1/O.zoom],["_",1/O.zoom]]);function io(o,e){if(e.ctrlKey||e.metaKey||e.altKey)return!1;let[t,r]=[Ii.get(e.key),Hi.get(e.key)];return t!==void 0&&e.shiftKey?o.pan(O.move*t[0],O.move*t[1]):t!==void 0?(o.rotateLeft(O.turn*t[0]),o.rotateUp(O.turn*t[1])):r!==void 0&&o.dollyIn(r),t!==void 0||r!==void 0}import{Vector3 as F}from"./vendor.js";var Vi=64;function ao(o,e){let{draft:t}=o,{cloth:r,border:n,disk:s}=e;if(t!==void 0&&M(t))return Ui(t,e);if(n!==void 0)return{handles:[n]};let i=t?.hole??r?.hole??s?.point.hole,a=o.step.patches.find(l=>l.hole.id===i),d=o.patches.find(l=>l.hole.id===i);if(a===void 0||d===void 0)return{};let c=o.reportOf(d.hole.id??0)?.grid?.spacingMean??0;return t===void 0?r?{handles:[ge(d,r)]}:s?co(s,d,c):{}:ji(t,a,d,c)}function co({point:o,radius:e},t,r){let n=ge(t,o),s=gn(n,new F(...G(t,o)),e*Vi*r);return{handles:[n],ring:s,disk:{center:n,ring:s}}}function Ui(o,{stretch:e}){switch(o.kind){case"cut":{let t=new F(...o.center);return{handles:[t],ball:{center:t,radius:o.radius}}}case"polygon":{let t=o.corners.map(r=>new F(...r));return{handles:t,stretches:[t.length<3?t:[...t,...t.slice(0,1)]]}}case"border":{let t=N(o).map(i=>new F(...i)),r=Mr(o).map(i=>i.map(a=>new F(...a))),{facing:n}=o,s=n===void 0?[e(o)]:[e(o,n),e(n,o)];return{handles:t,stretches:s,dashes:r}}}}function ji(o,e,t,r){switch(o.kind){case"grab":{let n=$(e,o.uv),s=n&&ge(e,n).add(new F(...o.offset));return n&&s?{handles:[s],tethers:[[ge(t,n),s]]}:{}}case"twist":{let n=$(t,o.uv);return n?co({point:n,radius:o.radius},t,r):{}}case"pinch":{let s=o.uvs.map(d=>$(t,d)).filter(d=>d!==void 0).map(d=>ge(t,d)),[i,a]=s;return{handles:s,tethers:i&&a?[[i,a]]:[]}}case"anchor":return{handles:[new F(...o.position)]}}}function ge(o,e){return new F(...W(o,e))}import{Vector3 as B}from"./vendor.js";var _i=4,Wi=16,Gi=Math.PI/200,dt={step:1.1,least:.02,most:.5},lo=new Map([["x",new B(1,0,0)],["y",new B(0,1,0)],["z",new B(0,0,1)]]),ho={cloth:void 0,onPatch:!1},ct=class extends PointerEvent{constructor(e){super("pointerdown",e)}},lt=class{constructor(e,t){this.viewer=e;this.editor=t;let{signal:r}=this.listening,n={capture:!0,signal:r},{canvas:s}=e;s.addEventListener("pointerdown",i=>this.down(i),n),s.addEventListener("pointermove",i=>this.move(i),n),s.addEventListener("pointerup",i=>this.up(i),n),s.addEventListener("pointercancel",()=>this.cancel(),n),s.addEventListener("pointerleave",()=>this.hover(void 0),{signal:r}),s.addEventListener("wheel",i=>this.wheel(i),{...n,passive:!1}),addEventListener("keydown",i=>this.key(i,!0),{signal:r}),addEventListener("keyup",i=>this.key(i,!1),{signal:r})}viewer;editor;hold;firstOfPinch;heldAxis;firstOfBorder;hovered;onMarks=()=>{};listening=new AbortController;get waitingPoint(){return this.editor.tool==="pinch"?this.firstOfPinch:void 0}get waitingEnd(){return this.editor.tool==="border"?this.firstOfBorder:void 0}get disk(){let{tool:e,work:t}=this.editor,r=this.hold===void 0?this.hovered:this.hold.cloth?.point;return e==="twist"&&t===void 0&&r?{point:r,radius:this.editor.twistRadius}:void 0}cancel(){this.hold=void 0,this.firstOfPinch=void 0,this.firstOfBorder=void 0,this.editor.dropDraft()}dispose(){this.listening.abort()}down(e){let{tool:t,work:r}=this.editor;if(e instanceof ct)return;if(this.hold!==void 0){this.joined(this.hold,e);return}if(t==="look"||r!==void 0||e.button!==0||!e.isPrimary)return;if(t==="border"){this.borderDown(e);return}let{draft:n}=this.editor;if(n?.kind==="polygon"&&this.takeHandle(e,n.corners))return;let s=this.viewer.pick(e.clientX,e.clientY),i=this.held(s?.cloth);if(t==="cut"||t==="polygon"){this.cutDown(e,s);return}s===void 0||i===void 0&&(t!=="anchor"||this.editor.editable.length===0)||(this.take(e,{hit:s,cloth:i}),this.onMarks())}hover(e){e!==this.hovered&&(this.hovered=e,this.onMarks())}take(e,{hit:t,cloth:r,part:n}){e.stopImmediatePropagation(),this.viewer.canvas.focus(),this.viewer.canvas.setPointerCapture(e.pointerId);let{pointerId:s,clientX:i,clientY:a}=e;this.hold={pointer:s,x:i,y:a,hit:t,cloth:r,part:n,moved:!1,before:this.editor.draft,last:e}}joined(e,t){if(t.pointerType!=="touch"||e.last.pointerType!=="touch"){t.stopImmediatePropagation();return}this.hold=void 0,e.before===void 0?this.editor.dropDraft():this.editor.preview(e.before),this.viewer.canvas.dispatchEvent(new ct(e.last))}takeHandle(e,t){let r=t.map(s=>new B(...s)),n=this.viewer.aim.nearestOf(r,{x:e.clientX,y:e.clientY},Wi);return n===void 0?!1:(this.take(e,{hit:{position:n,...ho},cloth:void 0,part:r.indexOf(n)}),!0)}cutDown(e,t){if(t===void 0)return;if(t.onPatch){e.stopImmediatePropagation(),this.editor.say("Only cloth of the scan itself can be cut out.");return}if(this.editor.tool==="polygon"){this.cornerDown(e,t);return}this.take(e,{hit:t,cloth:void 0});let{radius:r}=this.cutDraft();this.editor.preview({kind:"cut",center:t.position.toArray(),radius:r})}cornerDown(e,t){this.take(e,{hit:t,cloth:void 0,part:this.polygonDraft().corners.length});let r=this.polygonDraft();this.editor.preview({...r,corners:[...r.corners,t.position.toArray()]})}polygonDraft(){let{draft:e}=this.editor;return e?.kind==="polygon"?e:{kind:"polygon",corners:[]}}cutDraft(){let{draft:e,scan:t}=this.editor,r={loops:t?.loops??[],candidates:[]};return e?.kind==="cut"?e:we("cut",r)}borderDown(e){let{draft:t}=this.editor;if(t?.kind==="border"){this.takeHandle(e,N(t));return}let r=this.viewer.nearestOfBorder(e.clientX,e.clientY);r!==void 0&&this.take(e,{hit:{position:r,...ho},cloth:void 0})}bordered({hit:e,moved:t}){let{draft:r}=this.editor;if(t||r?.kind==="border")return;let n=this.firstOfBorder;if(n===void 0){this.firstOfBorder=e.position,this.editor.say("Border: click where the stretch ends.");return}this.firstOfBorder=void 0,this.editor.say("Border: drag its ends, or mend it."),this.editor.preview({kind:"border",from:n.toArray(),to:e.position.toArray(),along:[]})}movedHandle({hit:e,part:t=0},{clientX:r,clientY:n}){let{draft:s}=this.editor;if(s?.kind!=="border")return;let a=t<Ar(s)?this.viewer.nearestOfBorder(r,n):this.viewer.aim.onScreenPlane(r,n,e.position);return a&&Pe(s,t,a.toArray())}movedCorner({part:e=0},{clientX:t,clientY:r}){let{draft:n}=this.editor,s=this.viewer.pick(t,r),i=s!==void 0&&!s.onPatch;return n?.kind==="polygon"&&i?xe(n,e,s.position.toArray()):void 0}move(e){let{hold:t}=this;if(t===void 0&&e.buttons===0){let n=this.editor.tool==="twist";this.hover(n?this.viewer.pick(e.clientX,e.clientY)?.cloth:void 0)}if(t===void 0||e.pointerId!==t.pointer)return;e.stopImmediatePropagation(),t.last=e,t.moved||=Math.hypot(e.clientX-t.x,e.clientY-t.y)>_i;let r=t.moved?this.dragged(t,e):void 0;r!==void 0&&this.editor.preview(r)}up(e){let{hold:t}=this;if(t===void 0||e.pointerId!==t.pointer)return;e.stopImmediatePropagation(),this.hold=void 0,this.hover(e.pointerType==="touch"?void 0:t.cloth?.point);let{tool:r}=this.editor;r==="pinch"?this.pinched(t):r==="border"?this.bordered(t):r==="cut"?this.editor.say("Cut out: change the ball, or cut it out and mend."):r==="polygon"?this.editor.say(zi(this.editor.draft)):r==="anchor"&&!t.moved?(this.editor.preview(this.anchorAt(t,t.hit.position)),this.editor.commit()):t.moved&&this.editor.draft!==void 0&&this.editor.commit()}dragged(e,t){let{cloth:r}=e;switch(this.editor.tool){case"grab":return r&&this.grabbed(r,t);case"twist":return r&&this.twisted(r,t.clientX-e.x);case"anchor":{let n=this.viewer.aim.onScreenPlane(t.clientX,t.clientY,e.hit.position);return n&&this.anchorAt(e,n)}case"cut":{let s=this.viewer.aim.onScreenPlane(t.clientX,t.clientY,e.hit.position)?.distanceTo(e.hit.position)??0;return s>0?{kind:"cut",center:e.hit.position.toArray(),radius:s}:void 0}case"polygon":return this.movedCorner(e,t);case"border":return this.movedHandle(e,t);default:return}}grabbed({point:e,position:t,normal:r},n){let{clientX:s,clientY:i}=n,a=n.shiftKey?r:lo.get(this.heldAxis??""),d=a?this.viewer.aim.onLine(s,i,t,a):this.viewer.aim.onScreenPlane(s,i,t),{hole:c,uv:l}=e;return d&&{kind:"grab",hole:c,uv:l,offset:d.sub(t).toArray()}}twisted({point:e,normal:t},r){let n=t.clone();n.dot(this.viewer.camera.getWorldDirection(new B))>0&&n.negate();let{hole:s,uv:i}=e;return{kind:"twist",hole:s,uv:i,radius:this.editor.twistRadius,axis:n.toArray(),angle:-r*Gi}}anchorAt({cloth:e},t){let r=t.toArray(),n=br(this.editor.editable,r)?.hole.id??0,{draft:s}=this.editor,i=s?.kind==="anchor"&&s.hard;return{kind:"anchor",hole:e?.point.hole??n,position:r,hard:i}}pinched({cloth:e}){let t=this.firstOfPinch;if(e===void 0)return;if(t===void 0||t.hole!==e.point.hole){this.firstOfPinch=e.point,this.editor.say("Pinch: click the second point.");return}this.firstOfPinch=void 0;let r=[t.uv,e.point.uv];this.editor.say("Pinch: choose how much, then apply."),this.editor.preview({kind:"pinch",hole:t.hole,uvs:r,amount:.5})}wheel(e){let{draft:t}=this.editor;if(t?.kind==="cut"){let s=this.viewer.pick(e.clientX,e.clientY);s!==void 0&&s.position.distanceTo(new B(...t.center))<=t.radius&&(e.preventDefault(),e.stopImmediatePropagation(),this.editor.preview({...t,radius:t.radius*dt.step**-Math.sign(e.deltaY)}));return}let r=this.editor.tool==="twist"?this.viewer.pick(e.clientX,e.clientY)?.cloth:void 0;if(r===void 0)return;this.hovered=r,e.preventDefault(),e.stopImmediatePropagation();let n=this.editor.twistRadius*dt.step**-Math.sign(e.deltaY);this.editor.setTwistRadius(Math.min(Math.max(n,dt.least),dt.most))}key(e,t){let r=e.key.toLowerCase();t&&r==="escape"?this.cancel():lo.has(r)&&(t?this.hold!==void 0:r===this.heldAxis)&&(this.heldAxis=t?r:void 0)}held(e){let t=this.editor.step.patches.find(({hole:r})=>r.id===e?.hole);return e&&t&&{point:e,position:new B(...W(t,e)),normal:new B(...G(t,e))}}};function zi(o){let e=o?.kind==="polygon"?o.corners.length:0,t=e<3?"click the next one":"click another, or cut it out and mend";return`Cut out: ${e} ${e===1?"corner":"corners"}; ${t}.`}import{css as Yi,html as Xi}from"./vendor.js";import{css as qi,html as _,nothing as lr,unsafeCSS as ht}from"./vendor.js";var po=qi`
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
    background: ${ht(Gt("curvature"))};
  }
  .bar.confidence {
    background: ${ht(Gt("confidence"))};
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
    background: ${ht(Cn)};
  }
  .patch.own {
    background: ${ht(Tn)};
  }
`,uo="From blue over white to orange",Ki={stretch:{title:"Stretch",about:"Lengths of the cloth, compared with the same cloth laid flat.",unknown:"Grey: not laid flat: away from the mended holes.",bar:uo,ends:o=>{let e=`${g(o*100)} %`;return[`${Number(((1-1/(1+o))*100).toPrecision(2))} % shorter`,"as flat",`${e} longer`]}},curvature:{title:"Curvature",about:"Whether the cloth bends in two directions at once. Cloth that is only folded stays white.",unknown:"Grey: not known.",bar:uo,unit:"In one over the scan's unit squared.",ends:o=>[`saddle, \u2212${g(o)}`,"flat or folded, 0",`dome, ${g(o)}`]},confidence:{title:"Confidence",about:"How far new cloth may be off: nine of ten vertices lie within 1.6 times this of the cloth that was there. That is of the cloth before anchors and gestures.",unknown:"Dark grey: new cloth of which it is not known.",bar:"From light yellow over orange to dark brown",own:"Light grey: the scan's own cloth.",unit:"In the scan's unit.",ends:o=>["certain, 0",`uncertain, ${g(o)}`]}},Ji="Nothing is known: no hole is mended yet, or none that is has a chart and was filled with weights that were calibrated.";function fo(o,e){if(o===void 0)return lr;let{title:t,about:r,unknown:n,bar:s,own:i,unit:a,ends:d}=Ki[o];if(e===void 0)return _`<div class="legend" role="status"><strong>${t}</strong> is computed …</div>`;let c=Number.isNaN(e.most);return _`
    <div class="legend" role="group" aria-label="Legend: ${t}">
      <strong>${t}</strong>
      ${c?_`<p>${Ji}</p>`:_`<div class="bar ${o}" role="img" aria-label=${s}></div>
              <div class="ends">${d(e.most).map(l=>_`<span>${l}</span>`)}</div>
              <p>${r}</p>`}
      <p><span class="patch"></span> ${n}</p>
      ${i===void 0?lr:_`<p><span class="patch own"></span> ${i}</p>`}
      ${a===void 0||c?lr:_`<p class="quiet">${a}</p>`}
    </div>
  `}var Qi=60,hr=class extends m{static styles=[m.styles,po,Yi`
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
    `].flat();viewer;gestures;heat;scale;opened=()=>{this.show()};connectedCallback(){super.connectedCallback(),this.editor.addEventListener("opened",this.opened)}disconnectedCallback(){super.disconnectedCallback(),this.editor.removeEventListener("opened",this.opened),this.gestures?.dispose(),this.viewer?.dispose(),this.viewer=void 0}render(){return Xi`<div id="host"></div>
      ${fo(this.heat,this.scale)}`}firstUpdated(){let e=this.renderRoot.querySelector("#host");if(e===null)return;try{this.viewer=new rt(e),this.gestures=new lt(this.viewer,this.editor),this.gestures.onMarks=()=>this.requestUpdate()}catch(r){this.editor.report(new Error(`This browser draws no 3-D pictures (WebGL 2): ${String(r)}`));return}this.viewer.onError=r=>this.editor.report(r),this.viewer.onHeat=(r,n)=>{this.heat=r,this.scale=n,this.requestUpdate()};let{canvas:t}=this.viewer;t.setAttribute("role","img"),t.setAttribute("aria-label","The scan. Drag or arrow keys to turn it; two fingers, the right button or Shift and arrow keys to move it; the wheel, plus or minus to zoom; F to see all."),t.addEventListener("keydown",r=>{this.viewer!==void 0&&io(this.viewer.controls,r)&&r.preventDefault()}),t.addEventListener("dblclick",r=>{let n=this.viewer?.pick(r.clientX,r.clientY);n!==void 0&&this.viewer?.pivotAt(n.position)})}updated(){this.viewer?.chooseLoops(this.editor.chosen),this.viewer?.showPatches(this.editor.patches),this.viewer?.showCut(this.editor.step.cutFaces),this.viewer?.mark(ao(this.editor,{cloth:this.gestures?.waitingPoint,border:this.gestures?.waitingEnd,disk:this.gestures?.disk,stretch:(e,t)=>this.viewer?.stretchBetween(e,t)??[]}),this.editor.isAsking?Qi:0)}async show(){let{scan:e}=this.editor;if(e!==void 0)try{await this.viewer?.showScan(e.bytes,e.loops),this.requestUpdate()}catch(t){this.editor.report(new Error(`The scan was read by the service, but cannot be drawn: ${String(t)}`))}}};customElements.define("darn-stage",hr);import{css as Zi,html as b,nothing as E}from"./vendor.js";var ut=[{tool:"look",name:"Look",key:"L",help:"Drag to turn the scan, right button or two fingers to move it, wheel to zoom. With the picture in focus, the arrow keys turn it, with Shift they move it, + and - zoom."},{tool:"grab",name:S.grab,key:"G",help:"Drag new cloth in the plane of the screen; hold Shift to pull it along its normal, or X, Y or Z along an axis."},{tool:"twist",name:S.twist,key:"T",help:"Drag to the left or right on new cloth to turn a disk of it; the wheel changes its size."},{tool:"pinch",name:S.pinch,key:"P",help:"Click two points of new cloth, then choose how far to draw them together."},{tool:"anchor",name:S.anchor,key:"A",help:"Drag from the cloth to where it should be, or type the point; the service finds which place of the cloth belongs there. That place is a dot on the chart, which can be dragged."},{tool:"cut",name:S.cut,key:"C",help:"For stained, torn or badly scanned cloth: press on its middle and drag to its edge. What the ball touches is cut out, and new cloth is put in. The wheel changes its size."},{tool:"border",name:S.border,key:"E",help:"For a bite or a rip at the edge of the cloth: click where it begins and where it ends. New cloth goes up to the dashed line; add points where the new hem should go. Where the cloth is torn in two, add the edge that faces it: the two are joined."}],ea="For damaged cloth of any outline: click its corners one after another. A corner can be dragged, and Backspace takes the last one back. What lies under the polygon is cut out, and new cloth is put in.",ta=[["cut","Ball"],["polygon","Polygon"]];function pr(o){return!["look","cut","polygon","border"].includes(o)}var ra={grab:"Apply",twist:"Apply",pinch:"Apply",anchor:"Find its place",cut:"Cut out and mend",polygon:"Cut out and mend",border:"Mend up to the new hem"};function na(o){return o.kind==="anchor"&&o.uv!==void 0?"Apply":ra[o.kind]}var mo=b`<span class="wide quiet small">u and v: the place on the chart, from 0 to 1</span>`,oa=["x","y","z"],ur=class extends m{static styles=[m.styles,Zi`
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
      }
    `].flat();render(){let{tool:e,step:t,editable:r}=this.editor,n=e==="polygon"?"cut":e,s=e==="polygon"?ea:ut.find(i=>i.tool===e)?.help??"";return b`
      <h2>Tools</h2>
      <div class="row tools" role="group" aria-label="Tools">
        ${ut.map(i=>b`
            <button
              aria-pressed=${i.tool===n}
              aria-keyshortcuts=${i.key}
              title="${i.name} (${i.key})"
              ?disabled=${r.length===0&&pr(i.tool)}
              @click=${()=>this.editor.setTool(i.tool)}
            >
              ${i.name}
            </button>
          `)}
      </div>
      <p class="quiet small">${s}</p>
      ${r.length>0||e!=="look"?E:b`<p class="quiet small">${sa(t.patches.length)}</p>`}
      ${e==="look"?E:this.form(this.draftOf(e))}
    `}draftOf(e){let{draft:t,editable:r,scan:n}=this.editor,[s]=r;if(t?.kind===e)return t;if(e==="cut"||e==="polygon"||e==="border")return n&&we(e,n);let i=s&&mt(e,s);return i?.kind==="twist"?{...i,radius:this.editor.twistRadius}:i}form(e){if(e===void 0)return E;let{work:t}=this.editor,r=t!==void 0;return b`
      <form @submit=${n=>this.apply(n,e)}>
        ${M(e)?this.shapes(e):this.holeField(e)} ${this.fields(e)}
        <div class="row wide">
          <button class="main" ?disabled=${r||!xr(e)}>${na(e)}</button>
          <button type="button" ?disabled=${this.editor.draft===void 0} @click=${()=>this.editor.dropDraft()}>
            Cancel
          </button>
          ${e.kind==="anchor"?this.mapButton(e):E}
        </div>
      </form>
    `}mapButton(e){let{work:t,map:r}=this.editor;return r?.isComing?b`
        <button type="button" @click=${()=>this.editor.stopMap()}>Stop the map</button>
        <progress aria-label="The map" max="1" .value=${r.share}></progress>
      `:b`<button type="button" ?disabled=${t!==void 0} @click=${()=>{this.editor.drawMap(e)}}>Draw the map</button>`}holeField(e){let t=this.editor.editable;return t.length<2?E:b`
      <label class="wide">
        Hole
        <select @change=${n=>{let s=Number(n.target.value),i=t.find(({hole:a})=>a.id===s);i!==void 0&&this.preview(e.kind==="anchor"?{...e,hole:s}:mt(e.kind,i))}}>
          ${t.map(({hole:n})=>b`<option value=${n.id} ?selected=${n.id===e.hole}>${n.id}</option>`)}
        </select>
      </label>
    `}fields(e){switch(e.kind){case"grab":return this.grabFields(e);case"twist":return this.twistFields(e);case"pinch":return this.pinchFields(e);case"anchor":return this.anchorFields(e);case"cut":return this.cutFields(e);case"polygon":return this.polygonFields(e);case"border":return this.borderFields(e)}}grabFields(e){return b`
      ${mo} ${this.uvFields(e.uv,"",t=>({...e,uv:t}))}
      <span></span>
      ${this.vectorFields("Move",e.offset,t=>({...e,offset:t}))}
    `}twistFields(e){let t=e.angle*180/Math.PI;return b`
      ${mo} ${this.uvFields(e.uv,"",r=>({...e,uv:r}))}
      ${this.number("Radius",e.radius,r=>({...e,radius:r}))}
      ${this.vectorFields("Axis",e.axis,r=>({...e,axis:r}))}
      ${this.number("Angle in degrees",t,r=>({...e,angle:r*Math.PI/180}))}
    `}pinchFields(e){let[t,r]=e.uvs,n=s=>{this.preview({...e,amount:Number(s.target.value)})};return b`
      ${this.uvFields(t,"First ",s=>({...e,uvs:[s,r]}))}
      <span></span>
      ${this.uvFields(r,"Second ",s=>({...e,uvs:[t,s]}))}
      <span></span>
      <label class="wide">
        Share of their distance to take away: ${Math.round(e.amount*100)} %
        <input type="range" min="0" max="1" step="0.01" .value=${String(e.amount)} @input=${n} />
      </label>
    `}anchorFields(e){let t=r=>{this.preview({...e,hard:r.target.checked})};return b`
      ${this.vectorFields("Point",e.position,r=>({...e,position:r}))} ${this.placeFields(e)}
      <label class="wide choice">
        <input type="checkbox" .checked=${e.hard} @change=${t} />
        Hard: refuse it where the cloth cannot reach it
      </label>
    `}placeFields(e){let t=this.editor.editable.find(({hole:n})=>n.id===e.hole),r=e.uv??(t===void 0?void 0:be(t))??[.5,.5];return["u","v"].map((n,s)=>this.number(n,e.uv?.[s],i=>({...e,uv:r.with(s,i)})))}cutFields(e){return b`
      ${this.vectorFields("Centre",e.center,t=>({...e,center:t}))}
      ${this.number("Radius",e.radius,t=>({...e,radius:t}))} ${this.cutEdges()}
    `}polygonFields(e){let{corners:t}=e,{scan:r}=this.editor,n=()=>this.preview(Pr(e,r?.loops??[])),s=()=>this.preview(ke(e));return b`
      ${t.map((i,a)=>this.vectorFields(`Corner ${a+1}`,i,d=>xe(e,a,d)))}
      <div class="row wide">
        <button type="button" @click=${n}>Add a corner</button>
        <button type="button" ?disabled=${t.length===0} @click=${s}>Take the last corner back</button>
      </div>
      ${t.length<2?E:this.number("Depth",gt(e),i=>({...e,depth:i}))}
      ${this.cutEdges()}
    `}shapes({kind:e}){return e==="border"?E:b`
      <fieldset class="wide">
        <legend class="quiet small">Shape</legend>
        ${ta.map(([t,r])=>b`
            <label class="choice">
              <input
                type="radio"
                name="shape"
                .checked=${t===e}
                @change=${()=>this.editor.setTool(t)}
              />${r}
            </label>
          `)}
      </fieldset>
    `}cutEdges(){let{scan:e,chosen:t,work:r}=this.editor,s=(e?.loops??[]).filter(P).map(a=>a.id??0).filter(a=>t.has(a));return s.length===0?E:b`
      <div class="row wide">
        <button type="button" ?disabled=${r!==void 0} @click=${()=>{this.editor.make("Cut edges back",{cut:{loops:s}})}}>Cut the edges of chosen holes back</button>
      </div>
    `}borderFields(e){let{from:t,to:r,along:n,facing:s}=e,i=[0,1,2].map(u=>(t[u]+r[u])/2),a=()=>this.preview({...e,along:[...n,n.at(-1)??i]}),d=u=>this.preview({...e,along:n.filter((p,f)=>f!==u)}),l=["From","To",...s?["Facing from","Facing to"]:n.map((u,p)=>`Hem ${p+1}`)],h=N(e).map((u,p)=>this.vectorFields(l[p],u,f=>Pe(e,p,f)));return s!==void 0?b`
        ${h}
        <div class="row wide">
          <button type="button" @click=${()=>this.preview($r(e))}>Without the facing edge</button>
        </div>
      `:b`
      ${h}
      <div class="row wide">
        <button type="button" @click=${()=>this.preview(Sr(e))}>Join with a facing edge</button>
        <button type="button" @click=${a}>Add a point of the hem</button>
        ${n.length>0?b`<button type="button" @click=${()=>d(n.length-1)}>Remove the last point</button>`:E}
      </div>
    `}uvFields([e,t],r,n){return[this.number(`${r}u`,e,s=>n([s,t])),this.number(`${r}v`,t,s=>n([e,s]))]}vectorFields(e,t,r){return oa.map((n,s)=>this.number(`${e} ${n}`,t[s],i=>r(t.with(s,i))))}number(e,t,r){let n=s=>{let i=s.target.valueAsNumber;Number.isFinite(i)&&this.preview(r(i))};return b`
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
    `}preview(e){this.editor.preview(e)}apply(e,t){e.preventDefault(),this.editor.preview(t),this.editor.commit()}};customElements.define("darn-tools",ur);function sa(o){return o===0?"Mend a hole to edit its new cloth.":"The cloth around what is filled cannot be laid flat, so its new cloth takes no gestures."}import{html as ia}from"./vendor.js";function yo(o,e){return ia`
    <div class="welcome">
      <h2>Mend a scan of cloth</h2>
      <p>
        Drop a glTF file here: a GLB, or a glTF together with the files that it refers to. The service finds its holes
        and fills them with cloth that continues the folds around them. The scan itself stays as it is.
      </p>
      <div class="row">
        <button class="main" @click=${o}>Open a scan</button>
        <button id="example" @click=${e}>Try the example</button>
      </div>
    </div>
  `}var mr=class extends aa{static styles=[Q,da`
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
    `];static properties={src:{},key:{},baseUrl:{attribute:"base-url"}};dragging=!1;shown=Yt;savedLook="blended";made;constructor(){super(),this.addEventListener("dragover",this.dragOver),this.addEventListener("dragleave",this.dragLeave),this.addEventListener("drop",this.drop)}get editor(){return this.made??=this.makeEditor(),this.made}makeEditor(){let e=new it(this.base),t=async()=>{await this.updateComplete;let s=await this.keyDialog?.ask();return e.keep(s),s},r=new ce(this.base,{key:this.key??e.kept,askForKey:t}),n=new He(r);n.addEventListener("change",()=>this.requestUpdate()),n.addEventListener("opened",()=>{this.change({split:0}),this.emit("opened",{name:n.scan?.name})});for(let s of["mended","edited"])n.addEventListener(s,()=>{let{report:i,constraints:a}=n.step;this.emit(s,{report:i,constraints:a})});return n}get base(){return new URL(this.baseUrl??new URL("..",import.meta.url),document.baseURI)}connectedCallback(){super.connectedCallback(),addEventListener("keydown",this.keyDown),addEventListener("keyup",this.keyUp)}disconnectedCallback(){super.disconnectedCallback(),removeEventListener("keydown",this.keyDown),removeEventListener("keyup",this.keyUp)}willUpdate(e){let{src:t}=this;if(!(!e.has("src")||t===void 0))try{this.editor.openAddress(new URL(t,document.baseURI))}catch{this.editor.report(new Error(`${t} is not an address.`))}}emit(e,t){return this.dispatchEvent(new CustomEvent(e,{detail:t,bubbles:!0,composed:!0,cancelable:!0}))}render(){let{editor:e}=this,{scan:t,work:r}=e;return ee`
      <header>
        <h1>darn</h1>
        <button @click=${this.pick}>Open a scan</button>
        <button id="another" @click=${this.openExample} ?hidden=${t===void 0}>Open the example</button>
        <span class="quiet name" title=${t?.name??""}>${t?.name??""}</span>
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
        ${t===void 0&&r===void 0?yo(this.pick,this.openExample):fr} ${this.notices()}
        ${this.said()}
      </main>
      <aside
        @darn-frame=${this.frame}
        @darn-look=${this.look}
        @darn-saved-look=${this.chooseSavedLook}
        @darn-picture=${this.savePicture}
      >
        ${t===void 0?ee`<p class="quiet">The holes of the scan will be listed here.</p>`:ee`
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
    `}said(){let{work:e,problem:t,message:r}=this.editor;return ee`
      <div class=${e===void 0&&t===void 0&&r!==""?"said":"hidden"} role="status" aria-live="polite">${e?.label??r}</div>
    `}notices(){let{work:e,problem:t}=this.editor;return t!==void 0?ee`
        <div class="notice problem" role="alert">
          <p>${t}</p>
          <button @click=${()=>this.editor.clearProblem()}>Close</button>
        </div>
      `:e===void 0?fr:ee`
      <div class="notice">
        <div class="row">
          ${e.label} …
          <button @click=${()=>e.stop.abort()}>Stop</button>
        </div>
        <progress aria-label=${e.label} value=${e.share??fr}></progress>
      </div>
    `}get keyDialog(){return this.renderRoot.querySelector("darn-key")}get stage(){return this.renderRoot.querySelector("darn-stage")}pick=()=>this.renderRoot.querySelector("#file")?.click();picked=e=>{let t=e.target;this.openFiles([...t.files??[]]),t.value=""};async openFiles(e){try{let t=await Yr(e);t!==void 0&&await this.editor.open(t.file,t.name)}catch(t){this.editor.report(t)}}openExample=()=>{this.editor.openAddress(new URL("editor/scarf_hole.glb",this.base))};save=async()=>{let e=await this.editor.result();if(e!==void 0){let t=await tn(e,this.savedLook),n=(this.editor.scan?.name??"scan.glb").replace(/(\.[a-z]+)?$/i,s=>`.mended${s||".glb"}`);this.emit("saved",{file:t,name:n})&&V(t,n)}};chooseSavedLook=({detail:e})=>{this.savedLook=e,this.requestUpdate()};savePicture=async()=>{let e=await this.stage?.viewer?.picture();e!==void 0&&(V(e,`${Y(this.editor.scan?.name)}.png`),this.editor.say("The picture is saved."))};dragOver=e=>{e.preventDefault(),this.setDragging(!0)};dragLeave=()=>this.setDragging(!1);drop=e=>{e.preventDefault(),this.setDragging(!1),this.openFiles([...e.dataTransfer?.files??[]])};setDragging(e){this.dragging=e,this.requestUpdate()}frame=e=>this.stage?.viewer?.frame(e.detail);look=e=>this.change(e.detail);change(e){this.shown={...this.shown,...e},this.stage?.viewer?.setLook(e),this.requestUpdate()}keyDown=e=>{if(!this.isMeant(e))return;let t=e.key.toLowerCase();if((e.ctrlKey||e.metaKey)&&(t==="z"||t==="y")&&!go(e)){e.preventDefault(),t==="y"||e.shiftKey?this.editor.redo():this.editor.undo();return}if(e.ctrlKey||e.metaKey||e.altKey||go(e))return;let r=ut.find(s=>s.key.toLowerCase()===t)?.tool,n=this.editor.scan!==void 0&&(this.editor.editable.length>0||!pr(r??"look"));r!==void 0&&n?this.editor.setTool(r):t==="backspace"&&this.editor.draft?.kind==="polygon"?this.editor.preview(ke(this.editor.draft)):t==="f"?this.stage?.viewer?.frame():t==="b"&&this.stage?.viewer?.setLook({before:!0})};isMeant(e){let t=e.composedPath();return t.includes(this)||t[0]===document.body}keyUp=e=>{e.key.toLowerCase()==="b"&&this.stage?.viewer?.setLook({before:!1})}};function go(o){let e=o.composedPath()[0];return e instanceof HTMLTextAreaElement||e instanceof HTMLInputElement&&!["checkbox","radio","range","button"].includes(e.type)}customElements.define("darn-editor",mr);
