function se({hole:n}){return(n.patchUvs?.length??0)>0}function $(n,e){if(!se(n))return;let{patchFaces:t=[],patchUvs:r=[],id:o=0}=n.hole,s=i=>[r[2*i],r[2*i+1]];for(let i=0;i+2<t.length;i+=3){let a=t.slice(i,i+3),d=Go(e,a.map(s));if(d!==void 0)return{hole:o,uv:e,vertices:a,weights:d}}}function q({positions:n},{vertices:e,weights:t}){return[0,1,2].map(r=>e.reduce((o,s,i)=>o+t[i]*n[3*s+r],0))}function K({positions:n},{vertices:e}){let[t,r,o]=e.map(c=>[...n.subarray(3*c,3*c+3)]),[s,i]=[kt(r,t),kt(o,t)],a=[s[1]*i[2]-s[2]*i[1],s[2]*i[0]-s[0]*i[2],s[0]*i[1]-s[1]*i[0]],d=Math.hypot(...a)||1;return a.map(c=>c/d)}function Ae(n){let{rimUvs:e=[]}=n.hole,t=e.length/2||1,r=[0,1].map(i=>e.reduce((a,d,c)=>c%2===i?a+d:a,0)/t),o=n.hole.patchUvs??[],s={uv:r,distance:Number.POSITIVE_INFINITY};for(let i=0;i+1<o.length;i+=2){let a=[o[i],o[i+1]],d=Math.hypot(a[0]-r[0],a[1]-r[1]);d<s.distance&&(s={uv:a,distance:d})}return s.uv}function Or(n,e){let t;for(let r of n){let o=r.hole.rimPositions??[];for(let s=0;s+2<o.length;s+=3){let i=Math.hypot(...kt(o.slice(s,s+3),e));i<(t?.distance??Number.POSITIVE_INFINITY)&&(t={patch:r,distance:i})}}return t?.patch}function kt(n,e){return[n[0]-e[0],n[1]-e[1],n[2]-e[2]]}function Go([n,e],[t,r,o]){let s=(r[0]-t[0])*(o[1]-t[1])-(o[0]-t[0])*(r[1]-t[1]);if(s===0)return;let i=((n-t[0])*(o[1]-t[1])-(o[0]-t[0])*(e-t[1]))/s,a=((r[0]-t[0])*(e-t[1])-(n-t[0])*(r[1]-t[1]))/s,d=1-i-a,c=-1e-6;return d>=c&&i>=c&&a>=c?[d,i,a]:void 0}var Fr=new Map([["HOLE",{plural:"Holes",singular:"Hole",color:"#d9480f",line:"solid"}],["OPENING",{plural:"Openings",singular:"Opening",color:"#9c5fd0",line:"dotted"}],["TUBE_END",{plural:"Ends of sleeves",singular:"End of a sleeve",color:"#37a04d",line:"dotted"}],["OUTER_BOUNDARY",{plural:"Borders",singular:"Border",color:"#3f86c9",line:"dashed"}]]);function J(n){let e=n.toLowerCase().replaceAll("_"," "),t=e.charAt(0).toUpperCase()+e.slice(1);return Fr.get(n)??{plural:t,singular:t,color:"#862e9c",line:"dotted"}}function Br(n){let e=J(n).singular.toLowerCase();return`${/^[aeiou]/.test(e)?"an":"a"} ${e}`}function Nr(n,e){let t=(s,i,a)=>`${s} ${s===1?i:a}`,o=`${t(n.filter(A).length,"hole","holes")} in ${t(n.length,"boundary loop","boundary loops")}`;return e===0?o:`${o}, and ${t(e,"bite, rip or tear","bites, rips or tears")} at the border`}function A(n){return n.kind==="HOLE"}function Pt(n){return n.kind!=="OUTER_BOUNDARY"}function Y(n){let e=[...Fr.keys()],t=new Map(e.map(o=>[o,[]]));for(let o of n){let s=o.kind??"LOOP_KIND_UNSPECIFIED";t.set(s,[...t.get(s)??[],o])}let r=o=>o.length??0;return[...t].filter(([,o])=>o.length>0).map(([o,s])=>[o,s.sort((i,a)=>r(a)-r(i))])}function g(n){return n===void 0||!Number.isFinite(n)?"\u2013":n!==0&&(Math.abs(n)>=1e6||Math.abs(n)<.001)?n.toExponential(2):String(Number(n.toPrecision(3)))}function M(n){return n.kind==="cut"||n.kind==="polygon"||n.kind==="border"}function Ir(n){return n.kind!=="polygon"||n.corners.length>=3}var S={grab:"Grab",twist:"Twist",pinch:"Pinch",anchor:"Anchor",cut:"Cut out",polygon:"Cut out",border:"Border"},At=.125;function St(n,e){let t=e.hole.id??0,r=Ae(e),o=$(e,r);switch(n){case"grab":return{kind:n,hole:t,uv:r,offset:[0,0,0]};case"twist":return{kind:n,hole:t,uv:r,radius:At,axis:o?K(e,o):[0,1,0],angle:0};case"pinch":return{kind:n,hole:t,uvs:[r,[r[0]+.1,r[1]]],amount:.5};case"anchor":return{kind:n,hole:t,position:o?q(e,o):[0,0,0],hard:!1}}}function Se({border:n}){let e=({from:o,to:s})=>({from:ie(o),to:ie(s)}),{facing:t,along:r=[]}=n??{};return{kind:"border",...e(n??{}),along:r.map(ie),...t&&{facing:e(t)}}}function Vr(n,e){return n.filter(t=>!$t(t,e))}function $t(n,e){let t=JSON.stringify(ae(Se(n))),r=n.border?.facing!==void 0;return e.some(o=>"border"in o&&o.border.auto?!r:JSON.stringify(o)===t)}function $e(n,{loops:e,candidates:t}){let r=Hr(e),o=ie(r?.centroid);switch(n){case"cut":{let s=(r?.diameter??1)*(r?.kind==="HOLE"?.55:.05);return{kind:n,center:o,radius:s}}case"polygon":return{kind:n,corners:[]};case"border":{let[s]=t;return s?Se(s):{kind:n,from:o,to:o,along:[]}}}}function Hr(n){return Y(n)[0]?.[1][0]}function Ur(n,e){let{corners:t}=n;return{...n,corners:[...t,t.at(-1)??ie(Hr(e)?.centroid)]}}function Me(n,e,t){return{...n,corners:n.corners.map((r,o)=>o===e?t:r)}}function Ce(n){return{...n,corners:n.corners.slice(0,-1)}}function Mt({corners:n,depth:e}){let t=r=>Math.max(...n.map(o=>zo(r,o)));return e??Math.max(0,...n.map(t))/10}function ie([n=0,e=0,t=0]=[]){return[n,e,t]}function H({from:n,to:e,along:t,facing:r}){return r?[n,e,r.from,r.to]:[n,e,...t]}function jr({facing:n}){return n?4:2}function Ee(n,e,t){let r=H(n).with(e,t);if(n.facing===void 0){let[d,c,...l]=r;return{...n,from:d,to:c,along:l}}let[o,s,i,a]=r;return{...n,from:o,to:s,facing:{from:i,to:a}}}function _r({from:n,to:e}){return{kind:"border",from:n,to:e,along:[],facing:{from:n,to:e}}}function Wr({from:n,to:e}){return{kind:"border",from:n,to:e,along:[]}}function zo(n,e){return Math.hypot(n[0]-e[0],n[1]-e[1],n[2]-e[2])}function ae(n){switch(n.kind){case"cut":return{cut:{center:[...n.center],radius:n.radius}};case"polygon":return{cut:{polygon:n.corners.map(e=>[...e]),depth:Mt(n)}};case"border":{let e=n.along.map(o=>[...o]),t=n.facing&&{from:[...n.facing.from],to:[...n.facing.to]};return{border:{...{from:[...n.from],to:[...n.to]},...e.length>0&&{along:e},...t&&{facing:t}}}}}}function Ct(n,e){return{...n,edits:[...n.edits,qo(e)]}}function Te(n,{hole:e,position:t,hard:r,replaces:o},s){let i={hole:e,uv:[...s],position:[...t],...r&&{hard:r}},{anchors:a}=n,d=o===void 0||o>=a.length;return{...n,anchors:d?[...a,i]:a.with(o,i)}}function Et(n,e){if(!M(e))return e.kind==="anchor"?e.uv&&Te(n,e,e.uv):Ct(n,e)}function qo(n){let{hole:e}=n;switch(n.kind){case"grab":return{hole:e,grab:{uv:[...n.uv],offset:[...n.offset]}};case"twist":return{hole:e,twist:{uv:[...n.uv],radius:n.radius,axis:[...n.axis],angle:n.angle}};case"pinch":return{hole:e,pinch:{uvs:n.uvs.map(t=>[...t]),amount:n.amount}}}}var U=class{running;waiting;offer(e){if(this.running!==void 0){this.waiting=e;return}this.running=this.run(e)}async settled(){this.waiting=void 0,await this.running}async run(e){for(let t=e;t!==void 0;)await t(),t=this.waiting,this.waiting=void 0;this.running=void 0}};var w=class extends Error{constructor(t,r,o,s,i=[]){super(o);this.status=t;this.code=r;this.retryAfter=s;this.fields=i}status;code;retryAfter;fields;name="ProblemError";get keyIsRefused(){return this.status===401}get sessionIsGone(){return this.status===410||this.code==="session_not_found"}};function Le(n,e,t){let r=Number(e??Number.NaN),o=Number.isFinite(r)&&r>=0?r:void 0;try{let{code:s,detail:i,errors:a=[]}=JSON.parse(t);return new w(n,s??"",i??Gr(n),o,a)}catch{return new w(n,"",Gr(n),o)}}function Tt(n){return n instanceof w?Ko(n):n instanceof TypeError&&/fetch|network/i.test(n.message)?"The service cannot be reached.":De(n instanceof Error?n.message:String(n))}function de(n){return n instanceof DOMException&&n.name==="AbortError"}function Gr(n){return`The service answered with status ${n}.`}function Ko({code:n,message:e,fields:t}){if(n==="anchor_out_of_reach"&&t.length>0)return[...t.map(({pointer:i="",detail:a=""})=>De(`${zr(i)}: ${a}`)),"Move the point nearer to the cloth, or make the anchor soft."].join(`
`);let r=({pointer:s="",detail:i=""})=>De(`${zr(s)}: ${i}`);if(t.length>0&&t.every(({pointer:s="",detail:i=""})=>e.includes(`${s}: ${i}`)))return t.map(r).join(`
`);let o=t.filter(({detail:s=""})=>!e.includes(s));return[De(e),...o.map(r)].join(`
`)}function zr(n){let[,e="",t="",...r]=n.split("/");if(!/^\d+$/.test(t))return n||"The request";if(e==="holes"){let[i="",...a]=r,d=new Map([["border","Border"],["cut","Cut out"]]).get(i);return d===void 0?n:[d,...a].join(", ")}let o=new Map([["anchors","Anchor"],["edits","Gesture"]]).get(e),s=r.length>0?`, ${r.join(" ")}`:"";return o===void 0?n:`${o} ${Number(t)+1}${s}`}function De(n){let e=n.charAt(0).toUpperCase()+n.slice(1);return/[.!?]$/.test(e)?e:`${e}.`}var ce=class n{constructor(e,t,r,o){this.service=e;this.scan=t;this.selection=r;this.opened=o}service;scan;selection;opened;live=new U;met;static async open(e,t,r={},o={}){return new n(e,t,r,await e.openSession(t,r,o))}get holes(){return this.opened.holes??[]}get skipped(){return this.opened.skipped??[]}get cutFaces(){return this.opened.cutFaces??[]}drag(e,{onPatches:t,onError:r}){this.live.offer(async()=>{try{t(await this.draft(e))}catch(o){r(o)}})}async release(e,t={}){return await this.live.settled(),this.mend(e,t)}draft(e,t={}){return this.within(t,async r=>{let o=await this.service.draft(r,e,t),s=o.length/2,i=this.byHole(o.subarray(s));return this.byHole(o.subarray(0,s)).map((a,d)=>({...a,normals:i[d].positions}))})}positions(e,t={}){return this.within(t,async r=>{let o=await this.meeting(e,()=>this.service.positions(r,e,t));return this.byHole(o)})}mend(e,t={}){return this.within(t,async r=>{let{positions:o,report:s}=await this.meeting(e,()=>this.service.mend(r,e,t));return{patches:this.byHole(o),report:s}})}patches(e,t={}){return this.within(t,r=>this.meeting(e,()=>this.service.patches(r,e,t)))}optimizeAnchor(e,t={}){return this.within(t,r=>this.service.optimizeAnchor(r,e,t))}anchorMap(e,t,r={}){return this.within(r,o=>this.service.anchorMap(o,e,t,r))}result(e,t={}){return this.within(t,async r=>(await this.meet(r,e,t),this.service.result(r,t)))}close(){this.service.close(this.id)}get id(){return this.opened.id??""}async meet(e,t,r){this.met!==JSON.stringify(t)&&await this.meeting(t,()=>this.service.mend(e,t,r))}async meeting(e,t){this.met=void 0;let r=await t();return this.met=JSON.stringify(e),r}async within(e,t){try{return await t(this.id)}catch(r){if(!(r instanceof w&&r.sessionIsGone))throw r;return this.met=void 0,this.opened=await this.service.openSession(this.scan,this.selection,e),t(this.id)}}byHole(e){let t=0;return this.holes.map(r=>{let o=t+3*Jo(r),s=e.subarray(t,o);return t=o,{hole:r,positions:s}})}};function Jo({patchUvs:n=[],patchFaces:e=[]}){return n.length>0?n.length/2:e.reduce((t,r)=>Math.max(t,r+1),0)}async function*qr(n,e){let t=n.getReader(),r=new TextDecoder,[o,s,i]=["","",[]];try{for(;;){let{done:a,value:d}=await Yo(t.read(),e);if(a)return;o+=r.decode(d,{stream:!0});let c=o.split(/\r\n|\n|\r(?!$)/);o=c.pop()??"";for(let l of c){if(l===""){i.length>0&&(yield{id:s,data:i.join(`
`)}),i=[];continue}let[,h,u]=/^([^:]*)(?:: ?(.*))?$/.exec(l)??[];h==="data"?i.push(u??""):h==="id"&&(s=u??"")}}}finally{t.cancel().catch(()=>{})}}function Yo(n,e){return new Promise((t,r)=>{let o=setTimeout(()=>r(new Error("The service says nothing any more.")),e);n.then(t,r).finally(()=>clearTimeout(o))})}var Xo=5,Qo=60;function Kr(n,e={}){return typeof XMLHttpRequest>"u"?Dt(n.url,{method:"POST",headers:n.headers,body:n.body},e):Re(e,()=>Zo(n,e))}function Dt(n,e,t={}){return Re(t,async()=>{let r=await Lt(n,{...e,signal:t.signal??null});return{contentType:r.headers.get("content-type")??"",body:await r.arrayBuffer()}})}async function Lt(n,e){let t=await fetch(n,e);if(!t.ok)throw Le(t.status,t.headers.get("retry-after"),await t.text());return t}async function Jr(n,e){let t=n.body?.getReader(),r=new TextDecoder,o="";for(;;){let{done:s,value:i}=await t?.read()??{done:!0,value:void 0};o+=r.decode(i,{stream:!s});let a=o.split(`
`);o=s?"":a.pop()??"";for(let d of a.filter(c=>c!==""))e(JSON.parse(d));if(s)return}}function P(n){return JSON.parse(new TextDecoder().decode(n.body))}async function Re(n,e){for(let t=1;;t+=1)try{return await e()}catch(r){let o=r instanceof w&&r.status===503?r.retryAfter:void 0;if(o===void 0||o>Qo||t===Xo)throw r;n.onWait?.(o),await Rt(o,n.signal)}}function Rt(n,e){return new Promise((t,r)=>{let o=()=>{clearTimeout(s),r(new DOMException("stopped","AbortError"))},s=setTimeout(()=>{e?.removeEventListener("abort",o),t()},n*1e3);e?.aborted&&o(),e?.addEventListener("abort",o,{once:!0})})}function Zo({url:n,headers:e,body:t},{onSent:r,signal:o}){return new Promise((s,i)=>{let a=new XMLHttpRequest;a.open("POST",n);for(let[d,c]of Object.entries(e))a.setRequestHeader(d,c);a.responseType="arraybuffer",a.upload.onprogress=d=>{d.lengthComputable&&d.total>0&&r?.(d.loaded/d.total)},a.onload=()=>{let d=a.response;if(a.status<400)s({contentType:a.getResponseHeader("content-type")??"",body:d});else{let c=new TextDecoder().decode(d);i(Le(a.status,a.getResponseHeader("retry-after"),c))}},a.onerror=()=>i(new Error("The service cannot be reached, or it closed the connection.")),a.onabort=()=>i(new DOMException("stopped","AbortError")),o?.addEventListener("abort",()=>a.abort()),a.send(t)})}var es=45e3,Ot={first:.5,longest:30},le=class{constructor(e){this.transport=e}transport;async submit(e,t,r={},o={}){let s=new FormData;s.append("scan",e,"scan"),s.append("constraints",new Blob([JSON.stringify(t)],{type:"application/json"}),"constraints");let{name:i,priority:a,webhook:d,idempotencyKey:c=crypto.randomUUID()}=r,l=`jobs${Yr({name:i,priority:a,webhook:d})}`;return P(await this.transport.upload(l,s,o,{"idempotency-key":c}))}async get(e,t={}){return P(await this.transport.send(j(e),{},t))}async list({state:e,from:t,limit:r}={},o={}){return P(await this.transport.send(`jobs${Yr({state:e,from:t,limit:r})}`,{},o))}async result(e,t={}){let r=await this.transport.send(j(e,"result"),{},t);return new Blob([r.body],{type:r.contentType})}async report(e,t={}){return P(await this.transport.send(j(e,"report"),{},t))}async cancel(e,t={}){return P(await this.transport.send(j(e,"cancel"),{method:"POST"},t))}async retry(e,t={}){return P(await this.transport.send(j(e,"retry"),{method:"POST"},t))}async delete(e,t={}){await this.transport.send(j(e),{method:"DELETE"},t)}async*events(e,{lastVersion:t,signal:r}={}){let o=t;for(let s=Ot.first;;){try{let i=await this.transport.open(j(e,"events"),{headers:o===void 0?{}:{"last-event-id":String(o)},signal:r??null});if(i.status===204||i.body===null)return;for await(let a of qr(i.body,es)){let d=JSON.parse(a.data);if([o,s]=[d.version,Ot.first],yield d,Ft(d))return}}catch(i){if(de(i)||r?.aborted||i instanceof w&&!ts(i))throw i;s=Math.max(s,i instanceof w&&i.retryAfter||0)}await Rt(s,r),s=Math.min(2*s,Ot.longest)}}async wait(e,{onChange:t,...r}={}){for await(let o of this.events(e,r))if(t?.(o),Ft(o))return o;return this.get(e,r)}};function Ft(n){return n.state==="DONE"||n.state==="ERROR"||n.state==="CANCELLED"}function ts({status:n}){return n===429||n>=500}function j(n,e){let t=`jobs/${encodeURIComponent(n)}`;return e===void 0?t:`${t}/${e}`}function Yr(n){let e=Object.entries(n).filter(([,r])=>r!==void 0),t=new URLSearchParams(e.map(([r,o])=>[r,String(o)])).toString();return t===""?"":`?${t}`}function Bt(n,e){let t=/boundary="?([^";]+)"?/.exec(n)?.[1];if(!n.startsWith("multipart/mixed")||t===void 0)throw new Error(`multipart/mixed was asked for, ${n} was answered`);let r=new Uint8Array(e),o=new Map,s=0;for(;;){let i=rs(r,`\r
\r
`,s);if(i<0){if(!new TextDecoder().decode(r.subarray(s)).startsWith(`--${t}--`))throw new Error("a multipart/mixed answer ends before its last line");return o}let a=new TextDecoder().decode(r.subarray(s,i)).toLowerCase(),d=Number(/content-length: *(\d+)/.exec(a)?.[1]??Number.NaN),c=/name="([^"]*)"/.exec(a)?.[1],l=i+4;if(!a.includes(`--${t.toLowerCase()}`)||c===void 0||!(l+d<=r.length))throw new Error("a part of a multipart/mixed answer cannot be read");let h=/content-type: *([^\r\n;]+)/.exec(a)?.[1]??"";o.set(c,{mediaType:h,body:r.slice(l,l+d)}),s=l+d+2}}function rs(n,e,t){let r=[...e].map(s=>s.charCodeAt(0)),o=n.length-r.length;for(let s=t;s<=o;s+=1)if(r.every((i,a)=>n[s+a]===i))return s;return-1}function he(n){return{method:"POST",headers:{"content-type":"application/json"},body:JSON.stringify(n)}}var Oe=class{constructor(e,t){this.base=e;this.options=t;this.key=t.key}base;options;key;asked;send(e,t,r={}){return this.withKey(o=>Dt(this.at(e),Xr(t,o),r))}open(e,t){return this.withKey(r=>Lt(this.at(e),Xr(t,r)))}openPatiently(e,t,r){return Re(r,()=>this.open(e,t))}upload(e,t,r,o={}){return this.withKey(s=>Kr({url:this.at(e),headers:{...o,...Nt(s)},body:t},r))}forget(e,t){fetch(this.at(e),{method:t,keepalive:!0,headers:Nt(this.key)}).catch(()=>{})}async withKey(e){for(;;){let t=this.key;try{return await e(t)}catch(r){if(!(r instanceof w&&r.keyIsRefused))throw r;if(this.key===t){let o=await this.ask(r);if(o===void 0)throw r;this.key=o}}}}ask(e){return this.asked??=Promise.resolve(this.options.askForKey?.(e)).finally(()=>this.asked=void 0),this.asked}at(e){return new URL(e,this.base)}};function Xr(n,e){return{...n,headers:{...n.headers,...Nt(e)}}}function Nt(n){return n===void 0?{}:{authorization:`Bearer ${n}`}}var ue=class{constructor(e,t={}){this.base=e;this.transport=new Oe(e,t),this.jobs=new le(this.transport)}base;jobs;transport;async info(){return P(await this.transport.send("info",{}))}async holes(e,t){let r=new FormData;return r.append("scan",e,"scan"),P(await this.transport.upload("holes",r,t))}async openSession(e,t,r){let o=new FormData;return o.append("scan",e,"scan"),o.append("constraints",new Blob([JSON.stringify(t)],{type:"application/json"}),"constraints"),P(await this.transport.upload("sessions",o,r))}async positions(e,t,r){let o=await this.inpaint(e,t,"application/octet-stream",r);return new Float32Array(o.body)}async draft(e,t,r){let o=await this.transport.send(`sessions/${e}/inpaint?draft=true`,he(t),r);return new Float32Array(o.body)}async mend(e,t,r){let s=await this.inpaint(e,t,"multipart/mixed, application/octet-stream;q=0.9",r),{report:i,patches:a}=Qr(s);return{report:i,positions:new Float32Array(a.buffer)}}async patches(e,t,r){let o="multipart/mixed, model/gltf-binary;q=0.9",{report:s,patches:i}=Qr(await this.inpaint(e,t,o,r));return{report:s,glb:i.buffer}}async optimizeAnchor(e,t,r){return P(await this.transport.send(`sessions/${e}/optimize-anchor`,he(t),r))}async anchorMap(e,t,r,o){let s=he({...t,map:!0});s.headers={...s.headers,accept:"application/x-ndjson"},s.signal=o.signal??null;let i=({found:a,map:d,problem:c})=>{if(c!==void 0){let{status:l=500,code:h="",detail:u="",errors:p=[]}=c;throw new w(l,h,u,void 0,p)}a!==void 0&&r.onFound(a),d!==void 0&&r.onMap(d)};await Jr(await this.transport.openPatiently(`sessions/${e}/optimize-anchor`,s,o),i)}async result(e,t){let r=await this.transport.send(`sessions/${e}/result`,{},t);return new Blob([r.body],{type:r.contentType})}close(e){this.transport.forget(`sessions/${e}`,"DELETE")}inpaint(e,t,r,o){let s=he(t);return s.headers={...s.headers,accept:r},this.transport.send(`sessions/${e}/inpaint`,s,o)}};function Qr(n){let e=Bt(n.contentType,n.body),[t,r]=[e.get("report"),e.get("patches")];if(t===void 0||r===void 0)throw new Error("the answer has no report or no patches");return{report:JSON.parse(new TextDecoder().decode(t.body)),patches:r.body}}var Fe=class{constructor(e,t){this.hole=e;this.target=t}hole;target;losses=Array.from({length:4096},()=>null);known=0;total;stopped=new AbortController;get signal(){return this.stopped.signal}get share(){return this.total===void 0?0:Math.min(this.known/Math.max(this.total,1),1)}get isComing(){return!this.signal.aborted&&(this.total===void 0||this.known<this.total)}add({cells:e=[],losses:t=[],total:r=0}){e.forEach((o,s)=>this.losses[o]=t[s]??null),this.known+=e.length,this.total=r}stop(){this.stopped.abort()}};var Be=class{constructor(e){this.searched=e}searched;last;drawn;get found(){return this.last}get map(){return this.drawn}async find({hole:e,position:t},r){this.drawn!==void 0&&this.drawn.target.join()!==t.join()&&this.dropMap();let o={hole:e,target:[...t]},s=await this.searched.session()?.optimizeAnchor(this.searched.step(),o,r);if(s!==void 0)return this.last={hole:e,found:s},this.searched.say(`Found after ${s.evaluations} evaluations of the network.`),s.uv}async drawMap({hole:e,position:t}){this.stopMap();let r=new Fe(e,t);this.drawn=r,this.searched.say("The map is being drawn.");try{let o={onFound:i=>{this.last={hole:e,found:i},this.searched.changed()},onMap:i=>{r.add(i),this.searched.changed()}},s={hole:e,target:[...t]};await this.searched.session()?.anchorMap(this.searched.step(),s,o,{signal:r.signal}),this.searched.say("The map is complete.")}catch(o){r.stop(),this.searched.report(o)}}stopMap(){this.drawn?.isComing&&(this.drawn.stop(),this.searched.say("The map is stopped."))}forget(){this.last=void 0,this.dropMap()}dropMap(){this.drawn?.stop(),this.drawn=void 0}};function Ne(n){return Number.isInteger(n)&&n>=0&&n<8}function L(n){return`Fill ${n+1} of 8`}function It(n,e){let t=Vt(n,e),r=n===0?"the likeliest":"beside the likeliest";return t===void 0?`${L(n)}, ${r}.`:`${L(n)}. ${t}`}function Vt(n,e){let t=e?.holes??[];if(!(n===0||t.length===0||t.some(({patch:r})=>(r?.alternative??0)>0)))return t.length===1?"A smooth surface closes this hole: it has one fill only, which is shown.":"Smooth surfaces close these holes: each has one fill only, which is shown."}var X=[["synthesize","Images of its own"],["continue","The scan\u2019s images go on"],["flat","One colour"],["none","Grey"]],Ht="As darn decides";function Zr(n){return n===void 0||X.some(([e])=>e===n)}function pe(n){let e=X.find(([t])=>t===n)?.[1]??Ht;return`Colour of the new cloth: ${e.charAt(0).toLowerCase()}${e.slice(1)}`}var ns={synthesize:"synthesized",continue:"continued",flat:"flat",none:"none"};function en(n,e){let t=(e?.holes??[]).filter(s=>n!==void 0&&s.texture!==void 0&&s.texture.method!==ns[n]),r=t.map(({id:s})=>s).join(", "),o=t.length===0?"":` Not in ${t.length===1?"hole":"holes"} ${r}: see the report.`;return`${pe(n)}.${o}`}function tn({method:n,reason:e="",width:t=0,height:r=0}){return`Its colour: ${new Map([["synthesized",`images of its own, ${t} \xD7 ${r} texels`],["continued","that of the scan goes on"],["flat","one, the mean of the cloth around the hole"],["none","grey"]]).get(n??"")??n}${e===""?"":`; ${e}`}.`}var os=["fill","except","maxDiameter","minDiameter"],Ie={anchors:[],edits:[],alternative:0,texture:void 0};function rn({anchors:n,edits:e,...t},r,o){let s=({rimPositions:c=[]})=>c.join(),i=new Map(o.map(c=>[s(c),c.id??0])),a=new Map(r.map(c=>[c.id??0,i.get(s(c))])),d=c=>{let l=c.hole===void 0?void 0:a.get(c.hole);return c.hole===void 0?[c]:l===void 0?[]:[{...c,hole:l}]};return{anchors:n.flatMap(d),edits:e.flatMap(d),...t}}function Q(n){return{...n.anchors.length>0&&{anchors:[...n.anchors]},...n.edits.length>0&&{edits:[...n.edits]},...n.alternative>0&&{alternative:n.alternative},...n.texture!==void 0&&{texture:n.texture}}}function nn(n,{holes:e,made:t,acceptDoubtful:r,selection:o,more:s}){if(o!==void 0)return{...o,...s,...r&&{acceptDoubtful:r}};let i=h=>h.id??0,a=n.filter(A).map(i),c=[...n.filter(h=>!A(h)&&e.includes(i(h))).map(h=>({id:i(h)})),...t],l=a.filter(h=>!e.includes(h));return{...c.length>0&&{holes:c},...c.length>0&&l.length<a.length&&{fill:"holes"},...l.length>0&&{except:l},...s,...r&&{acceptDoubtful:r}}}function on(n,{holes:e,made:t,acceptDoubtful:r,selection:o,more:s},i){let a=e.filter(d=>n.some(c=>(c.id??0)===d));return{...o??{holes:[...a.map(d=>({id:d})),...t]},...s,...r&&{acceptDoubtful:r},...Q(i)}}function sn(n){let e;try{e=JSON.parse(n)}catch(m){throw new Error(`The constraints are not JSON: ${m instanceof Error?m.message:String(m)}`)}if(typeof e!="object"||e===null||Array.isArray(e))throw new Error("The constraints must be a JSON object.");let{holes:t,acceptDoubtful:r=!1,anchors:o=[],edits:s=[],alternative:i=0,texture:a,...d}=e;if(!Ut(o)||!Ut(s))throw new Error("`anchors` and `edits` must be lists of objects.");if(typeof r!="boolean")throw new Error("`acceptDoubtful` must be true or false.");if(!Ne(i))throw new Error(`\`alternative\` must be a whole number from 0 to ${7}.`);if(!Zr(a))throw new Error(`\`texture\` must be one of ${X.map(([m])=>m).join(", ")}.`);let c=m=>os.includes(m),l=Object.entries(d),h=Object.fromEntries(l.filter(([m])=>c(m))),u=Object.fromEntries(l.filter(([m])=>!c(m))),{isOwn:p,...f}=ss(t),x=p&&Object.keys(h).length===0?void 0:{...t!==void 0&&{holes:t},...h};return{...f,acceptDoubtful:r,selection:x,more:u,constraints:{anchors:o,edits:s,alternative:i,texture:a}}}function an({holes:n,made:e,acceptDoubtful:t,selection:r,more:o},s,i){let a=i.filter(A).map(c=>c.id??0);return{holes:[...n??(s.holes.length>0?s.holes:a)].sort((c,l)=>c-l),made:e,acceptDoubtful:t,selection:r,more:o}}function ss(n){if(n===void 0)return{holes:void 0,made:[],isOwn:!0};if(!Ut(n))throw new Error("`holes` must be a list of objects.");let e=[],t=[],r=!0;for(let o of n)typeof o.id=="number"&&Number.isInteger(o.id)?e.push(o.id):typeof o.cut=="object"?t.push({cut:o.cut}):o.border==="auto"?t.push({border:{auto:!0}}):typeof o.border=="object"?t.push({border:o.border}):r=!1;return{holes:e,made:t,isOwn:r}}function Ut(n){return Array.isArray(n)&&n.every(e=>typeof e=="object"&&e!==null)}var Ve={label:"Open",holes:[],made:[],acceptDoubtful:!1,selection:void 0,more:{},constraints:Ie,patches:[],cutFaces:[],report:void 0};var is="darn reconstruction";function He(n){return n.byteLength>=20&&new TextDecoder().decode(n.slice(0,4))==="glTF"}function _t(n){return n.slice(20,20+new DataView(n).getUint32(12,!0))}function Z(n){let e=He(n)?_t(n):n;try{return JSON.parse(new TextDecoder().decode(e))}catch{return{}}}function Ue({images:n=[],meshes:e=[]}){let t=e.flatMap(({primitives:r=[]})=>r.flatMap(o=>Object.keys(o.attributes??{})));return n.length>0||t.some(r=>r.startsWith("COLOR_"))}function dn({meshes:n=[],materials:e=[]},t){let r=new Map;for(let[o,s]of t.entries()){let{name:i,pbrMetallicRoughness:a}=e[n[o]?.primitives?.[0]?.material??-1]??{};if(i!==is||a===void 0||a.baseColorTexture!==void 0)continue;let{baseColorFactor:d=[1,1,1],roughnessFactor:c=1,metallicFactor:l=1}=a;r.set(s,{color:d.slice(0,3),roughness:c,metalness:l})}return r}var fe=class{states;at=0;constructor(e){this.states=[e]}get present(){return this.states[this.at]}get canUndo(){return this.at>0}get canRedo(){return this.at+1<this.states.length}get next(){return this.states[this.at+1]}push(e){this.states.length=this.at+1,this.states.push(e),this.at+=1}undo(){this.at=Math.max(this.at-1,0)}redo(){this.at=Math.min(this.at+1,this.states.length-1)}};var je=class{constructor(e){this.drafted=e}drafted;made;answered;asking=!1;live=new U;get draft(){return this.made}get patches(){return this.answered}get isAsking(){return this.asking}show(e){this.made=e,this.drafted.changed(),Et(this.drafted.step().constraints,e)!==void 0&&this.live.offer(()=>this.ask(e))}drop(){this.made=void 0,this.answered=void 0,this.drafted.changed()}settled(){return this.live.settled()}async ask(e){let[t,r]=[this.drafted.step(),this.drafted.session()],o=Et(t.constraints,e);if(!(this.made!==e||r===void 0||o===void 0)){this.asking=!0;try{let s=await r.preview(t,o);this.made!==void 0&&this.drafted.step()===t&&(this.answered=s)}catch(s){this.drafted.report(s)}finally{this.asking=!1,this.drafted.changed()}}}};var as="The cloth around it cannot be laid flat: a fair surface without folds, which takes no gestures.",ds=1.645,cs=new Set(["not_selected","excepted","outer_boundary","tube_end","opening"]);function Gt(n){return n.filter(({code:e=""})=>!cs.has(e))}function cn({id:n,reason:e=""}){return`Left open: ${qt(e.replace(`hole ${n}: `,""))}.`}var zt="Mend with doubtful cloth, too";function qt(n){return n.replaceAll("`acceptDoubtful`",`\u201C${zt}\u201D`)}function ln(n){let e=n.patch??{},t=(e.faces??0).toLocaleString("en"),r=e.alternative??0,o=[`Hole ${n.id}: ${t} new triangles, area ${g(e.area)}, on a rim of length ${g(n.length)}.`,`${ls(e.stretchMean,e.stretchMax)} ${hs(e.selfIntersections??0)}`,e.method==="fair"?as:us(e.networkShare),r>0?It(r):"",n.texture===void 0?"":tn(n.texture),ps(e.confidence,(n.anchors??[]).length+(n.edits??[]).length)];if(n.cut!==void 0&&(n.cut.faces??0)>0){let s=(n.cut.faces??0).toLocaleString("en");o.push(`${s} triangles of the scan were cut out first, area ${g(n.cut.area)}.`)}for(let s of n.anchors??[]){let i=s.beyondReach??0,a=i>0?`; ${g(i)} of that is beyond the cloth's reach`:"";o.push(`An anchor is ${g(s.distance)} away from the cloth${a}.`)}for(let s of n.edits??[])o.push(`A gesture is followed to within ${g(s.distance)}.`);return[...o,...(n.doubts??[]).map(s=>`Doubtful: ${s}.`),...n.notes??[]].filter(s=>s!=="")}function hn(n){let e=n.holes?.length??0,t=n.skipped?.length??0,r=t===1?"1 loop is":`${t} loops are`;return`${Kt(e,"hole")} filled; ${r} left open.`}function un({label:n,constraints:e,patches:t,report:r}){if(n===L(e.alternative))return It(e.alternative,r);if(n===pe(e.texture))return en(e.texture,r);let o=t.reduce((a,d)=>a+(d.hole.patchFaces?.length??0)/3,0),s=Gt(r?.skipped??[]).length,i=(r?.holes??[]).filter(({doubts:a=[]})=>a.length>0).length;return[`${n}: ${t.length} filled, ${o.toLocaleString("en")} new triangles.`,...s>0?[`${Kt(s,"hole")} left open; the list says why.`]:[],...i>0?[`${i} with doubtful cloth.`]:[]].join(" ")}function ls(n,e){return n===void 0||e===void 0?"":`Lengths differ from those of flat cloth by ${Wt(n-1)} on average, ${Wt(e-1)} at most.`}function hs(n){return n===0?"No triangles cross.":`${Kt(n,"pair")} of triangles cross.`}function us(n){return n===void 0?"":n>=.995?"The network predicts its folds.":n<=.005?"A fair surface without folds, as the cloth around it has none.":`${Wt(n)} of the network's folds, for the rest a fair surface.`}function ps(n,e){if(n?.median===void 0)return"";let r=[["very high",n.veryHigh],["high",n.high],["medium",n.medium],["low",n.low],["very low",n.veryLow]].map(([i,a=0])=>[i,Math.round(100*a)]).filter(([,i])=>i>0).map(([i,a])=>`${i} at ${a} %`),o=e>0?"Before anchors and gestures, half":"Half",s=g(ds*n.median);return`${o} of the new vertices have nine chances in ten to lie within ${s} of the cloth that was there; confidence is ${r.join(", ")} of the vertices.`}function Wt(n){return`${Number((Math.abs(n)*100).toPrecision(2))} %`}function Kt(n,e){return`${n} ${e}${n===1?"":"s"}`}var fs=/\.(glb|gltf)$/i,ms=[[/\.png$/i,"image/png"],[/\.jpe?g$/i,"image/jpeg"],[/\.webp$/i,"image/webp"]];async function pn(n){let e=n.find(({name:o})=>fs.test(o))??n[0];if(e===void 0)return;let{name:t}=e;if(!/\.gltf$/i.test(t))return{file:e,name:t};let r;try{r=JSON.parse(await e.text())}catch{return{file:e,name:t}}for(let o of[...r.buffers??[],...r.images??[]])o.uri!==void 0&&!o.uri.startsWith("data:")&&(o.uri=await gs(ys(n,o.uri),o));return{file:new Blob([JSON.stringify(r)],{type:"model/gltf+json"}),name:t}}function ee(n="scan"){return n.replace(/\.(glb|gltf)$/i,"")}async function fn(n,e){let t=await fetch(n,{signal:e??null});if(!t.ok)throw new Error(`${n.href} answered with status ${t.status}.`);return new Blob([await t.arrayBuffer()],{type:"model/gltf-binary"})}function ys(n,e){let t=decodeURIComponent(e).split("/").pop(),r=n.find(({name:o})=>o===t);if(r===void 0)throw new Error(`The scan refers to the file ${t}; drop both together.`);return r}async function gs(n,e){let t=ms.find(([i])=>i.test(n.name))?.[1],r=e.mimeType??t??"application/octet-stream",o=new Uint8Array(await n.arrayBuffer()),s="";for(let i=0;i<o.length;i+=32768)s+=String.fromCharCode(...o.subarray(i,i+32768));return`data:${r};base64,${btoa(s)}`}var _e=class{constructor(e,t){this.service=e;this.scan=t}service;scan;opened;get skipped(){return this.opened?.cloth.skipped??[]}get cutFaces(){return this.opened?.cloth.cutFaces??[]}async holes(e,t){return(await this.open(e,t)).cloth.holes}async mend(e,t,r){let o=await this.open(e,r),s=await this.dress(o,t.texture,r),{patches:i,report:a}=await o.cloth.mend(Q(t),r);return{patches:yn(i,s),report:bs(a,s)}}async preview(e,t){let r=await this.open(e,{}),o=await this.dress(r,t.texture,{});return yn(await r.cloth.draft(Q(t)),o)}async optimizeAnchor(e,t,r){return(await this.open(e,r)).cloth.optimizeAnchor(t,r)}async anchorMap(e,t,r,o){await(await this.open(e,o)).cloth.anchorMap(t,r,o)}async result(e,t,r){return(await this.open(e,r)).cloth.result(Q(t),r)}close(){this.opened?.cloth.close(),this.opened=void 0}async open(e,t){let r=mn(e);if(this.opened!==void 0&&[this.opened.asked,this.opened.filled].includes(r))return this.opened;let{file:o,loops:s}=this.scan,i=await ce.open(this.service,o,nn(s,e),t);this.close();let a=mn({...e,holes:i.holes.map(({id:d=0})=>d)});return this.opened={asked:r,filled:a,cloth:i,dressings:new Map},this.opened}async dress({cloth:e,dressings:t},r,o){let s=t.get(r);if(s!==void 0)return s;let i=Q({...Ie,texture:r}),a=await e.positions(i,o),{glb:d,report:c}=await e.patches(i,o),l=c.holes??[],h=Ue(this.scan.document)?l:[],u={glb:d,positions:new Map(a.map(p=>[p.hole.id??0,p.positions])),textures:new Map(h.flatMap(({id:p=0,texture:f})=>f===void 0?[]:[[p,f]])),colours:dn(Z(d),l.map(({id:p=0})=>p))};return t.set(r,u),u}};function mn({holes:n,made:e,acceptDoubtful:t,selection:r,more:o}){return JSON.stringify([n,e,t,r,o])}function yn(n,e){return n.map(t=>({...t,dressing:e}))}function bs(n,{textures:e}){let t=(n.holes??[]).map(r=>{let o=e.get(r.id??0);return o===void 0?r:{...r,texture:o}});return{...n,holes:t}}var We=class{constructor(e){this.varied=e}varied;wanted;get isWaiting(){return this.wanted!==void 0}get newest(){return this.wanted??this.varied.step().constraints}async choose(e){let{isWaiting:t,varied:r}=this,{alternative:o,texture:s}=this.newest;if(this.wanted={alternative:o,texture:s,...e},t)return;let i;for(;r.step()!==i&&!r.isBusy();){i=r.step();let a=vs(i.constraints,this.wanted);a!==void 0&&await r.apply(a.label,a.constraints)}this.wanted=void 0}};function vs(n,{alternative:e,texture:t}){if(e!==n.alternative)return{label:L(e),constraints:{...n,alternative:e}};if(t!==n.texture)return{label:pe(t),constraints:{...n,texture:t}}}var Ge=class extends EventTarget{constructor(t){super();this.service=t;this.limits=t.info().catch(()=>{})}service;scan;chosen=new Set;acceptDoubtful=!1;isRefusedAsDoubtful=!1;skipped=[];tool="look";twistRadius=At;work;problem;message="";history=new fe(Ve);session;hand=new je({step:()=>this.step,session:()=>this.session,changed:()=>this.changed(),report:t=>this.report(t)});search=new Be({step:()=>this.step,session:()=>this.session,changed:()=>this.changed(),say:t=>this.say(t),report:t=>this.report(t)});wanted=new We({step:()=>this.step,isBusy:()=>this.work!==void 0,apply:(t,r)=>this.apply(t,this.step,r)});limits;get step(){return this.history.present}get draft(){return this.hand.draft}get draftPatches(){return this.hand.patches}get isAsking(){return this.hand.isAsking}get found(){return this.search.found}get map(){return this.search.map}get editable(){return this.step.patches.filter(se)}get alternative(){return this.wanted.newest.alternative}get texture(){return this.wanted.newest.texture}get canVary(){return this.step.patches.length>0&&(this.work===void 0||this.wanted.isWaiting)}get patches(){return this.draftPatches??this.step.patches}get undoLabel(){return this.history.canUndo?this.history.present.label:void 0}get redoLabel(){return this.history.next?.label}reportOf(t){return this.step.report?.holes?.find(r=>r.id===t)}async open(t,r){await this.working(`Sending ${r}`,async o=>{let s=(await this.limits)?.limits.bodyBytes;if(s!==void 0&&t.size+4096>s)throw new Error(`${r} has ${t.size} bytes; this service takes at most ${s}.`);let i=await t.arrayBuffer(),{loops:a=[],candidates:d=[],notes:c=[]}=await this.service.holes(t,o);this.session?.close(),this.scan={file:t,name:r,bytes:i,loops:a,candidates:d,notes:c,document:Z(i)},this.session=new _e(this.service,this.scan),this.history=new fe(Ve),this.chosen=new Set(a.filter(A).map(l=>l.id??0)),this.skipped=[],this.acceptDoubtful=this.isRefusedAsDoubtful=!1,this.search.forget(),this.dropDraft(),this.message=`${r} is open: ${Nr(a,d.length)}.`,this.dispatchEvent(new Event("opened"))})}async openAddress(t){let r=decodeURIComponent(t.pathname.split("/").pop()??"")||t.host,o;await this.working(`Loading ${r}`,async({signal:s})=>{o=await fn(t,s)}),o!==void 0&&await this.open(o,r)}choose(t){this.chosen=t,this.changed()}setAcceptDoubtful(t){this.acceptDoubtful=t,this.changed()}async mend(){let t=[...this.chosen].sort((s,i)=>s-i),r=`${t.length} ${t.length===1?"hole":"holes"}`,{acceptDoubtful:o}=this;await this.fill(`Mend ${r}`,{...this.step,holes:t,acceptDoubtful:o,selection:void 0})}async make(t,r){let{step:o,acceptDoubtful:s}=this;await this.fill(t,{...o,made:[...o.made,r],acceptDoubtful:s,selection:void 0})}async unmake(t){let{step:r}=this,o=r.made.filter(i=>i!==t),s=r.holes.filter(i=>this.scan?.loops.some(a=>a.id===i));s.length+o.length===0?(this.history.push({...Ve,label:"Put back"}),this.say("Put back: nothing is mended.")):await this.fill("Put back",{...r,holes:s,made:o,selection:void 0})}preview(t){t.kind==="twist"&&(this.twistRadius=t.radius),this.hand.show(t)}setTwistRadius(t){let{draft:r}=this;r?.kind==="twist"?this.preview({...r,radius:t}):(this.twistRadius=t,this.say(`Twist: radius ${t.toFixed(3)} of the chart.`))}async commit(){let{draft:t}=this;if(t!==void 0)if(M(t))await this.make(S[t.kind],ae(t));else if(t.kind==="anchor"&&t.uv!==void 0)await this.apply("Move anchor",this.step,Te(this.step.constraints,t,t.uv));else if(t.kind==="anchor")await this.placeAnchor(t);else{let r=Ct(this.step.constraints,t);await this.apply(S[t.kind],this.step,r)}}dropDraft(){this.hand.drop()}async chooseFill(t){Ne(t)&&await this.vary({alternative:t})}async vary(t){if(this.canVary){let r=this.wanted.choose(t);this.changed(),await r,this.changed()}}async drawMap(t){this.problem=void 0,await this.search.drawMap(t)}stopMap(){this.search.stopMap()}async placeAnchor(t){let r;if(await this.working("Searching",async o=>{r=await this.search.find(t,o)}),r!==void 0){let o=Te(this.step.constraints,t,r);await this.apply(t.hard?"Hard anchor":S.anchor,this.step,o)}}undo(){this.travel(()=>this.history.undo(),"Undone")}redo(){this.travel(()=>this.history.redo(),"Redone")}setTool(t){this.tool=t,this.dropDraft()}constraintsText(){let t=on(this.scan?.loops??[],this.step,this.step.constraints);return JSON.stringify(t,void 0,2)}async loadConstraints(t){let r;try{r=sn(t)}catch(s){this.report(s);return}let o=an(r,this.step,this.scan?.loops??[]);this.acceptDoubtful=o.acceptDoubtful,await this.apply("Load constraints",o,r.constraints),this.choose(new Set(this.step.holes))}async result(){let t;return await this.working("Saving",async r=>{let{holes:o,constraints:s}=this.step;t=await this.session?.result(this.step,s,r),this.message=`Saved with ${o.length} filled ${o.length===1?"hole":"holes"}.`}),t}say(t){this.message=t,this.changed()}report(t){de(t)||(this.isRefusedAsDoubtful=t instanceof w&&t.code==="no_plausible_fill",this.problem=qt(Tt(t)),this.changed())}clearProblem(){this.problem=void 0,this.changed()}async fill(t,r){let{step:o,draft:s}=this;await this.working(t,async i=>{let{session:a}=this;if(a!==void 0){let d=await a.holes(r,i),c=rn(o.constraints,o.patches.map(l=>l.hole),d);await this.take(t,{choice:r,constraints:c},i),this.dispatchEvent(new Event("mended"))}}),(this.step!==o||s===void 0||!M(s))&&this.dropDraft()}async apply(t,r,o){let{step:s}=this;await this.working(t,async i=>{(r.selection!==void 0||r.holes.length+r.made.length>0)&&(await this.take(t,{choice:r,constraints:o},i),this.dispatchEvent(new Event("edited")))}),this.step!==s&&this.dropDraft()}async take(t,{choice:r,constraints:o},s){let{session:i}=this;if(i===void 0)return;let{patches:a,report:d}=await i.mend(r,o,s),{skipped:c,cutFaces:l}=i;this.skipped=c;let h=a.map(v=>v.hole.id??0),{made:u,acceptDoubtful:p,selection:f,more:x}=r,m={holes:h,made:u,acceptDoubtful:p,selection:f,more:x};this.history.push({label:t,...m,constraints:o,patches:a,cutFaces:l,report:d}),this.message=un(this.history.present)}travel(t,r){let o=this.step;this.work===void 0&&(t(),this.step!==o&&(this.message=`${r}. Now: ${this.step.label}.`,this.search.forget(),this.problem=void 0),this.dropDraft())}async working(t,r){this.work?.stop.abort();let o=new AbortController,s=(i,a)=>{o.signal.aborted||(this.work={label:i,share:a,stop:o},this.changed())};this.problem=void 0,s(t,void 0);try{await this.hand.settled(),await r({signal:o.signal,onSent:i=>s(i<1?t:"Computing",i<1?i:void 0),onWait:i=>s(`The service is busy; waiting ${i} s`,void 0)})}catch(i){this.report(i)}finally{this.work?.stop===o&&(this.work=void 0),this.changed()}}changed(){this.dispatchEvent(new Event("change"))}};var ze=[["blended","Reconstruction blended","Like the cloth around it"],["marked","Reconstruction marked","Marked by glowing stripes"]],gn="KHR_materials_variants";async function bn(n,e){if(!n.type.startsWith("model/gltf"))return n;let t=await n.arrayBuffer(),r=He(t)?_t(t):new Uint8Array(t),o=JSON.parse(new TextDecoder().decode(r));if(!ws(o,e))return n;let[s,{type:i}]=[JSON.stringify(o),n];return He(t)?xs(s,t.slice(20+r.byteLength),i):new Blob([s],{type:i})}function ws(n,e){let t=ze.find(([s])=>s===e)?.[1],r=n.extensions?.[gn]?.variants?.findIndex(s=>s.name===t)??-1,o=!1;for(let s of n.meshes?.flatMap(({primitives:i=[]})=>i)??[]){let a=(s.extensions?.[gn]?.mappings??[]).find(({variants:d=[]})=>d.includes(r))?.material;a!==void 0&&a!==s.material&&(s.material=a,o=!0)}return o}function xs(n,e,t){let r=new TextEncoder().encode(n),o=new Uint8Array((4-r.length%4)%4).fill(32),s=r.length+o.length,i=new DataView(new ArrayBuffer(20));return[1179937895,2,20+s+e.byteLength,s,1313821514].forEach((d,c)=>i.setUint32(4*c,d,!0)),new Blob([i,r,o,e],{type:t})}import{Box3 as _i,DirectionalLight as Wi,HemisphereLight as Gi,Sphere as zi,Vector3 as lt}from"./vendor.js";import{Plane as Rs,Raycaster as Os,Vector2 as Fs,Vector3 as Xt}from"./vendor.js";import{DepthTexture as ks,Mesh as Ps,NearestFilter as vn,NoBlending as As,PlaneGeometry as Ss,SRGBColorSpace as $s,ShaderMaterial as Ms,UnsignedIntType as Cs,Vector2 as Es,WebGLRenderTarget as Ts}from"./vendor.js";var xn=0,E=1,wn=2,Ds=`
varying vec2 place;
void main() {
  place = uv;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`,Ls=`
uniform sampler2D colors;
uniform sampler2D depths;
varying vec2 place;
void main() {
  vec4 color = texture2D(colors, place);
  gl_FragColor = vec4(color.rgb / max(color.a, 1e-4), color.a);
  #include <colorspace_fragment>
  gl_FragColor.rgb *= color.a;
  gl_FragDepth = texture2D(depths, place).r;
}`,qe=class{constructor(e){this.scene=e;let t=new Ms({uniforms:this.uniforms,vertexShader:Ds,fragmentShader:Ls,blending:As});this.picture=new Ps(new Ss(2,2),t),this.picture.layers.set(wn),this.picture.frustumCulled=!1,this.picture.renderOrder=-1,e.add(this.picture)}scene;target;isCurrent=!1;uniforms={colors:{value:null},depths:{value:null}};picture;forget(){this.isCurrent=!1}draw(e,t){let r=this.targetOf(e),o=this.isCurrent;return o||(t.layers.set(xn),e.setRenderTarget(r),e.render(this.scene,t),e.setRenderTarget(null),this.isCurrent=!0),t.layers.set(E),t.layers.enable(wn),e.render(this.scene,t),Yt(t),o}dispose(){this.target?.dispose(),this.picture.geometry.dispose(),this.picture.material.dispose()}targetOf(e){let{x:t,y:r}=e.getDrawingBufferSize(new Es);return this.target?.width===t&&this.target.height===r?this.target:(this.target?.dispose(),this.isCurrent=!1,this.target=new Ts(t,r,{samples:4,colorSpace:$s,minFilter:vn,magFilter:vn,depthTexture:new ks(t,r,Cs)}),this.uniforms.colors.value=this.target.texture,this.uniforms.depths.value=this.target.depthTexture,this.target)}};function Yt(n){n.layers.set(xn),n.layers.enable(E)}var Ke=class{constructor(e,t){this.canvas=e;this.camera=t;this.raycaster.layers.enable(E)}canvas;camera;raycaster=new Os;at(e,t){let{left:r,top:o,width:s,height:i}=this.canvas.getBoundingClientRect(),a=new Fs((e-r)/s*2-1,1-(t-o)/i*2);return this.camera.updateMatrixWorld(),this.raycaster.setFromCamera(a,this.camera),this.raycaster}onScreenPlane(e,t,r){let{ray:o}=this.at(e,t),s=new Rs().setFromNormalAndCoplanarPoint(this.camera.getWorldDirection(new Xt),r);return o.intersectPlane(s,new Xt)??void 0}onLine(e,t,r,o){let{origin:s,direction:i}=this.at(e,t).ray,a=r.clone().sub(s),d=o.dot(i),c=(d*i.dot(a)-o.dot(a))/Math.max(1-d*d,1e-6);return r.clone().addScaledVector(o,c)}nearestOf(e,t,r){let{left:o,top:s,width:i,height:a}=this.canvas.getBoundingClientRect();this.camera.updateMatrixWorld();let d,c=new Xt;for(let l of e){c.copy(l).project(this.camera);let[h,u]=[o+(c.x+1)/2*i,s+(1-c.y)/2*a],p=Math.hypot(h-t.x,u-t.y);Math.abs(c.z)<=1&&p<=Math.min(r,d?.distance??r)&&(d={point:l,distance:p})}return d?.point}};function me(n,e){return[e[0]-n[0],e[1]-n[1],e[2]-n[2]]}function ye([n,e,t],r,o){return[n+o*r[0],e+o*r[1],t+o*r[2]]}function kn(n,e){return n[0]*e[0]+n[1]*e[1]+n[2]*e[2]}function T(n,e){return Math.hypot(n[0]-e[0],n[1]-e[1],n[2]-e[2])}function Pn(n,e,t){let r=me(e,t),o=kn(r,r),s=o>0?kn(me(e,n),r)/o:0;return T(n,ye(e,r,Math.min(Math.max(s,0),1)))}function ge(n){return n.reduce((e,t,r)=>e+T(t,n[r-1]??t),0)}var An=1.5,Je=class{constructor(e,{kind:t,turning:r=0}){this.line=e;this.count=e.points.length/3,this.goesRound=t==="OPENING"||t==="TUBE_END";let o=e.angles.reduce((s,i)=>s+Math.PI-i,0);this.noise=(o-r)/this.count}line;count;goesRound;noise;place(e){let t=3*((e%this.count+this.count)%this.count),{points:r}=this.line;return[r[t],r[t+1],r[t+2]]}turning(e){return Math.PI-this.line.angles[e%this.count]-this.noise}ahead(e,t){return((t-e)%this.count+this.count)%this.count}nearest([e,t,r]){let{points:o}=this.line,s={vertex:0,square:Number.POSITIVE_INFINITY};for(let i=0;i<this.count;i+=1){let a=3*i,[d,c,l]=[o[a]-e,o[a+1]-t,o[a+2]-r],h=d*d+c*c+l*l;h<s.square&&(s={vertex:i,square:h})}return{vertex:s.vertex,distance:Math.sqrt(s.square)}}},_=class{constructor(e,t,r){this.edge=e;this.from=t;this.edges=r}edge;from;edges;get to(){return(this.from+this.edges)%this.edge.count}get rest(){return this.edge.count-this.edges}get places(){return Array.from({length:this.edges+1},(e,t)=>this.edge.place(this.from+t))}get length(){return ge(this.places)}get isBite(){return this.offABite<An}get offABite(){let e=0;for(let t=1;t<this.edges;t+=1)e+=this.edge.turning(this.from+t);return Math.abs(e+Math.PI)}overlaps(e){let t=(r,o)=>this.edge.ahead(r.from,o)<=r.edges;return this.edge===e.edge&&(t(this,e.from)||t(e,this.from))}};function Sn([n,e]){let[t,r]=n.length<=e.length?[n,e]:[e,n];return r.offABite+An<t.offABite?r:t}var Bs=8,Mn=4096,Ns=64;function Ye(n,e,t=[]){let r=[Qt(n),Qt(e)],o=r.reduce((c,l)=>c+l.length-1,0),s=r.reduce((c,l)=>c+ge(l),0)/o,[i,a]=[R(n,0),R(e,0)],d=t.length===0?Is(n,e,s):Vs([i,...t,a],s);return d.filter((c,l)=>l===0||T(c,d[l-1])>0)}function R({edge:n,vertex:e,step:t},r){return n.place(e+t*r)}function Qt(n){let e=Math.max(Math.min(Bs,Math.floor((n.edges-1)/2)),1);return Array.from({length:e+1},(t,r)=>R(n,r))}function Is(n,e,t){let[r,o]=[R(n,0),R(e,0)],s=T(r,o),[i,a]=[Zt($n(n),-s),Zt($n(e),s)],d=l=>{let[h,u]=[l*l,l*l*l];return[[r,2*u-3*h+1],[i,u-2*h+l],[o,3*h-2*u],[a,u-h]].reduce((f,[x,m])=>ye(f,x,m),[0,0,0])},c=l=>Array.from({length:l+1},(h,u)=>d(u/l));return c(Cn(ge(c(Ns)),t)).with(-1,o)}function Vs(n,e){let t=n.slice(0,1);for(let[r,o]of n.slice(1).entries()){let s=n[r],i=Cn(T(s,o),e);for(let a=1;a<=i;a+=1)t.push(ye(s,me(s,o),a/i));if(t.length>Mn)break}return t.with(-1,n.at(-1))}function $n(n){let e=Qt(n),t=me(e[0],e.at(-1)),r=Math.hypot(...t);return r>0?Zt(t,1/r):[0,0,0]}function Zt(n,e){return ye([0,0,0],n,e)}function Cn(n,e){let t=Math.round(n/e);return Number.isFinite(t)?Math.min(Math.max(t,1),Mn):1}var Hs=2;function Dn(n,e){let{facing:t}=e;if(t!==void 0){let[s,i]=[En(n,e,t),En(n,t,e)];return s&&i?_s(s,i):{stretches:js(s,i),hems:[]}}let r=Ln(n,e),o=r&&Sn(r);return o?Rn(o,o===r[0]?e.along:e.along.toReversed()):Us}var Us={stretches:[],hems:[]};function js(...n){return n.flatMap(e=>e===void 0?[]:[e.places])}function Ln(n,{from:e,to:t}){let r=n.map(h=>({edge:h,ends:[h.nearest(e),h.nearest(t)]})),o=({ends:h})=>h[0].distance+h[1].distance,[s,...i]=r;if(s===void 0)return;let{edge:a,ends:d}=i.reduce((h,u)=>o(u)<o(h)?u:h,s),[c,l]=[d[0].vertex,d[1].vertex];if(c!==l)return[new _(a,c,a.ahead(c,l)),new _(a,l,a.ahead(l,c))]}function En(n,e,{from:t,to:r}){let o=Ln(n,e),s=i=>i.places.reduce((a,d)=>a+Pn(d,t,r),0)/(i.edges+1);return o&&(s(o[0])<=s(o[1])?o[0]:o[1])}function er({edge:n,from:e,to:t},r){return[{edge:n,vertex:e,step:-1,edges:r},{edge:n,vertex:t,step:1,edges:r}]}function Rn(n,e){let[t,r]=er(n,n.rest);return{stretches:[n.places],hems:[Ye(t,r,e)]}}function _s(n,e){let t=[n.places,e.places],r=n.edge===e.edge,o=r?Tn(n,e)??Tn(e,n):void 0;if(o!==void 0)return Rn(o,[]);if(n.overlaps(e)||!r&&n.edge.goesRound&&e.edge.goesRound)return{stretches:t,hems:[]};let s=(m,v)=>m.edge.ahead(m.to,v.from),i=m=>r?Math.min(s(n,e),s(e,n)):m.rest,[a,d]=er(n,i(n)),[c,l]=er(e,i(e)),h=(m,v)=>T(R(m,0),R(v,0)),u=h(a,l)+h(c,d),p=h(a,c)+h(l,d),[f,x]=u<=p?[l,c]:[c,l];return{stretches:t,hems:[Ye(a,f),Ye(x,d)]}}function Tn(n,e){let{edge:t}=n,r=new _(t,n.to,t.ahead(n.to,e.from)),o=r.length<=Hs*T(t.place(r.from),t.place(r.to)),s=new _(t,n.from,n.edges+r.edges+e.edges);return o&&s.edges<t.count&&s.isBite?s:void 0}function On(n,e){let t=new Set(e),r=new Map;for(let o of n){let{centroid:s=[],length:i=0}=o,a;for(let d of t){let l=(Math.hypot(...d.centroid.map((h,u)=>h-(s[u]??0)))+Math.abs(d.length-i))/(i||1);l<(a?.cost??.05)&&(a={line:d,cost:l})}a!==void 0&&(t.delete(a.line),r.set(o.id??0,a.line))}return r}import{BufferAttribute as Ws,BufferGeometry as Gs,DoubleSide as Fn,Group as zs,Line as Bn,Line2 as Un,LineBasicMaterial as qs,LineGeometry as Ks,LineLoop as Js,LineMaterial as Ys,Mesh as Xe,MeshBasicMaterial as tr,SphereGeometry as Xs,Vector3 as rr}from"./vendor.js";var Qs=7,Nn=64,Qe=750213,In=12723548,Zs=15856629,Vn="cut",Hn="twist",Ze=class{group=new zs;ball=new Xs(1,24,16);ballMaterial=new tr({color:Qe,depthTest:!1,transparent:!0});cutMaterial=new tr({color:In,transparent:!0,opacity:.35,depthWrite:!1,side:Fn});diskMaterial=new tr({color:Qe,transparent:!0,opacity:.3,depthTest:!1,side:Fn});lineMaterial=new qs({color:Qe,depthTest:!1,transparent:!0});shown="{}";show(e){let t=JSON.stringify(e);return t===this.shown?!1:(this.clear(),this.shown=t,this.add(e),!0)}add({handles:e=[],tethers:t=[],ring:r=[],disk:o,ball:s,stretches:i=[],dashes:a=[]}){if(s!==void 0){let d=new Xe(this.ball,this.cutMaterial);d.position.copy(s.center),d.scale.setScalar(s.radius),d.name=Vn,this.group.add(d)}if(o!==void 0){let d=new Xe(ei(o.center,o.ring),this.diskMaterial);d.name=Hn,this.group.add(d)}for(let d of i.filter(c=>c.length>1))this.group.add(nr(d,{color:In,linewidth:6}));for(let d of a.filter(c=>c.length>1)){let c=d.reduce((h,u,p)=>h+u.distanceTo(d[Math.max(p-1,0)]??u),0),l={dashed:!0,dashSize:c/30,gapSize:c/40};this.group.add(nr(d,{color:Zs,linewidth:5})),this.group.add(nr(d,{color:Qe,linewidth:3,...l}))}for(let d of e){let c=new Xe(this.ball,this.ballMaterial);c.position.copy(d),this.group.add(c)}for(let d of t)this.group.add(new Bn(or(d),this.lineMaterial));r.length>0&&this.group.add(new Js(or(r),this.lineMaterial));for(let d of this.group.children)d.renderOrder=10,d.layers.set(E)}clear(){this.shown="{}";for(let e of this.group.children)e instanceof Un?(e.geometry.dispose(),e.material.dispose()):(e instanceof Bn||e.name===Hn)&&e.geometry.dispose();this.group.clear()}fit(e,t){let r=2*Math.tan(e.fov*Math.PI/360)/Math.max(t,1);for(let o of this.group.children)o instanceof Xe&&o.geometry===this.ball&&o.name!==Vn&&o.scale.setScalar(Qs*r*e.position.distanceTo(o.position))}};function jn(n,e,t){let o=(Math.abs(e.x)<.9?new rr(1,0,0):new rr(0,1,0)).cross(e).normalize(),s=new rr().crossVectors(e,o).normalize();return Array.from({length:Nn},(i,a)=>{let d=2*Math.PI*a/Nn;return n.clone().addScaledVector(o,t*Math.cos(d)).addScaledVector(s,t*Math.sin(d))})}function ei(n,e){let t=e.flatMap((r,o)=>[n,r,e[(o+1)%e.length]??r]);return or(t)}function nr(n,e){let t=new Ks;t.setPositions(n.flatMap(o=>o.toArray()));let r=new Un(t,new Ys({depthTest:!1,transparent:!0,...e}));return r.computeLineDistances(),r}function or(n){let e=new Float32Array(n.flatMap(t=>t.toArray()));return new Gs().setAttribute("position",new Ws(e,3))}import{BufferAttribute as ho,Color as Mi,DoubleSide as fo,GLTFLoader as Ci,Mesh as mo,MeshStandardMaterial as cr,Triangle as Ei,Vector3 as uo}from"./vendor.js";var ti=3.2*Math.PI;function Gn(n,e,t){let r=n.length/3,o=new Float64Array(r),s=new Float64Array(r),i=new Float32Array(3*r),a=new Int32Array(r);_n(e,t,([u,p,f])=>{let x=ni(n,u,p,f),m=Math.hypot(...x);for(let[v,Lr,Rr]of[[u,p,f],[p,f,u],[f,u,p]]){o[v]=o[v]+Math.atan2(m,oi(n,v,Lr,Rr)),s[v]=s[v]+m/6,a[v]=a[v]+Wn(Lr)-Wn(Rr)|0;for(let oe=0;oe<3;oe+=1)i[3*v+oe]=i[3*v+oe]+x[oe]}});let d=o.map((u,p)=>a[p]!==0||u===0?(s[p]=0,0):u>ti?(s[p]=s[p]/2,2*Math.PI-u/2):2*Math.PI-u),c=new Float64Array(2*r);_n(e,t,([u,p,f])=>{let x=d[u]+d[p]+d[f],m=s[u]+s[p]+s[f];for(let v of[u,p,f])c[2*v]=c[2*v]+x,c[2*v+1]=c[2*v+1]+m});let l=new Float32Array(r),h=new Float32Array(r);for(let u=0;u<r;u+=1){let p=t[u],f=c[2*p+1];l[u]=f>0?c[2*p]/f:Number.NaN,h[u]=ri(i.subarray(3*p,3*p+3))}return{curvature:l,shade:h}}var sr=[.39,.49,.78];function ri([n=0,e=0,t=0]){let r=Math.hypot(n,e,t)||1;return Math.abs(n*sr[0]+e*sr[1]+t*sr[2])/r}function _n(n,e,t){let r=o=>e[n[o]];for(let o=0;o+2<n.length;o+=3){let[s,i,a]=[r(o),r(o+1),r(o+2)];s!==i&&i!==a&&a!==s&&t([s,i,a])}}function Wn(n){let e=Math.imul(n+1,2654435761);return e^e>>>15}function ni(n,e,t,r){let o=(h,u)=>n[3*h+u]-n[3*e+u],[s,i,a,d,c,l]=[o(t,0),o(t,1),o(t,2),o(r,0),o(r,1),o(r,2)];return[i*l-a*c,a*d-s*l,s*c-i*d]}function oi(n,e,t,r){let o=(s,i)=>n[3*s+i]-n[3*e+i];return o(t,0)*o(r,0)+o(t,1)*o(r,1)+o(t,2)*o(r,2)}function zn({hole:n,positions:e}){let{patchDeviations:t=[]}=n,r=e.length/3;return t.length===r?new Float32Array(t):new Float32Array(r).fill(Number.NaN)}var et=[[.02,.19,.38],[.13,.4,.67],[.57,.77,.87],[.97,.97,.97],[.99,.72,.39],[.88,.51,.08],[.5,.23,.03]],Kn=[[1,.97,.74],[1,.85,.4],[.98,.62,.2],[.85,.38,.08],[.58,.2,.04],[.3,.08,.03]],si={stretch:et,curvature:et,confidence:Kn},Jn=[.42,.44,.47],Yn=[.725,.745,.775],qn=.3,O=1024,ii={stretch:ir(et),curvature:ir(et),confidence:ir(Kn)},Xn=Float32Array.from({length:O+1},(n,e)=>(1-qn+qn*e/O)**2.2);function tt(n,e,t){let r=new Float32Array(3*n.length),o=ii[t.heat];for(let s=0;s<n.length;s+=1){let i=ai(n[s],t),a=Xn[Math.round(O*e[s])],d=Number.isFinite(i)?Math.round(O*Math.min(Math.max(i,0),1)):O+1;for(let c=0;c<3;c+=1)r[3*s+c]=o[3*d+c]*a}return r}function ai(n,{heat:e,most:t}){switch(e){case"stretch":return(Math.log(n)/Math.log(1+t)+1)/2;case"curvature":return(n/t+1)/2;case"confidence":return n===0?0:n/t}}function Qn(n){let e=Yn.map(ro),t=new Float32Array(3*n.length);for(let r=0;r<t.length;r+=1){let o=Xn[Math.round(O*n[Math.floor(r/3)])];t[r]=e[r%3]*o}return t}function ar(n){return`linear-gradient(to right, ${si[n].map(dr).join()})`}var Zn=dr(Jn),eo=dr(Yn);function to(n,e){if(n==="confidence"){let s=e.flatMap(i=>[...i]).reduce((i,a)=>a>i?a:i,-1);return{heat:n,most:s<0?Number.NaN:s}}let t=[];for(let s of e){let i=Math.max(1,Math.floor(s.length/2e4));for(let a=0;a<s.length;a+=i){let d=s[a],c=n==="stretch"?Math.exp(Math.abs(Math.log(d)))-1:Math.abs(d);Number.isFinite(c)&&t.push(c)}}t.sort((s,i)=>s-i);let r=t[Math.floor(.95*t.length)]??0,o=n==="stretch"?.02:Number.MIN_VALUE;return{heat:n,most:di(Math.max(r,o))}}function di(n){let e=10**Math.floor(Math.log10(n)),t=[1,2,5,10].find(r=>r*e>=n*.9999)??10;return Number((t*e).toPrecision(1))}function dr(n){return`rgb(${n.map(e=>Math.round(255*e)).join()})`}function ir(n){let e=Array.from({length:O+1},(t,r)=>ci(n,r/O));return Float32Array.from([...e,Jn].flatMap(t=>t.map(ro)))}function ci(n,e){let t=e*(n.length-1),r=Math.min(Math.floor(t),n.length-2),[o,s]=[n[r],n[r+1]];return o.map((i,a)=>i+(s[a]-i)*(t-r))}function ro(n){return n<=.04045?n/12.92:((n+.055)/1.055)**2.4}import{Box3 as mi,BufferAttribute as io,DoubleSide as so,Mesh as yi,MeshBVH as gi,MeshBasicMaterial as bi,MeshStandardMaterial as vi,Vector3 as be,acceleratedRaycast as wi}from"./vendor.js";var rt=class{constructor(e,t){this.slack=t;let r=s=>e[3*s],o=Array.from({length:e.length/3},(s,i)=>i).sort((s,i)=>r(s)-r(i));this.sorted=Float64Array.from(o.flatMap(s=>e.slice(3*s,3*s+3)))}slack;sorted;has(e,t,r){let{sorted:o,slack:s}=this,[i,a]=[0,o.length/3];for(;i<a;){let d=i+a>>1;o[3*d]<e-s?i=d+1:a=d}for(let d=3*i;d<o.length&&o[d]<=e+s;d+=3)if(Math.abs(o[d+1]-t)<=s&&Math.abs(o[d+2]-r)<=s)return!0;return!1}};function no(n,e,t){let r,o=(s,i)=>n[3*s+i];for(let s=0;s+2<e.length;s+=3){let[i,a,d]=[e[s],e[s+1],e[s+2]],c=l=>(o(i,l)+o(a,l)+o(d,l))/3;t.has(c(0),c(1),c(2))&&(r??=e.slice(),r.fill(e[s],s,s+3))}return r}var ot=class{worker;waiting=new Map;nextId=0;async boundary(e){let t=await this.ask({...e,job:"boundary"});return"lines"in t?t.lines:nt(t)}async tree(e){let t=await this.ask({...e,job:"tree"});return"tree"in t?t.tree:nt(t)}async numbers(e){let t=await this.ask({...e,job:"numbers"});return"numbers"in t?t.numbers:nt(t)}async stretch(e,t){let r=await this.ask({...e,job:"stretch",cells:t});return"stretch"in r?r.stretch:nt(r)}stop(){this.worker?.terminate(),this.worker=void 0;for(let[e,t]of this.waiting)t({id:e,error:"stopped"});this.waiting.clear()}ask(e){this.worker??=this.start();let t=this.nextId;this.nextId+=1;let r=new Promise(o=>this.waiting.set(t,o));return this.worker.postMessage({...e,id:t},[e.positions.buffer,e.triangles.buffer]),r}start(){let e=new Worker(li(),{type:"module"});return e.onmessage=({data:t})=>{this.waiting.get(t.id)?.(t),this.waiting.delete(t.id)},e.onerror=()=>this.stop(),e}};function li(){let n=new URL("./worker.js",import.meta.url);if(n.origin===location.origin)return n;let e=`import ${JSON.stringify(n.href)};`;return URL.createObjectURL(new Blob([e],{type:"text/javascript"}))}function nt(n){throw new Error("error"in n?n.error:"the worker answered something else")}import{DRACOLoader as hi,GLTFLoader as ui,MeshoptDecoder as pi}from"./vendor.js";var fi="KHR_draco_mesh_compression";async function oo(n){let e=new ui().setMeshoptDecoder(pi),{extensionsUsed:t=[]}=Z(n);if(!t.includes(fi))return(await e.parseAsync(n,"")).scene;let{DECODER:r}=await import("./draco.js"),[o,s]=[r.script,r.wasm].map(a=>URL.createObjectURL(new Blob([a]))),i=new hi().setDecoderPath({js:o,wasm:s});try{return(await e.setDRACOLoader(i).parseAsync(n,"")).scene}finally{i.dispose(),URL.revokeObjectURL(o),URL.revokeObjectURL(s)}}function F(n){return n==="textured"||n==="shaded"||n==="wireframe"?void 0:n}var xi=12172998;function it(n,e){return F(e)!==void 0?new bi({vertexColors:!0,side:so}):new vi({color:n,roughness:.85,side:so,wireframe:e==="wireframe"})}var st=class n{constructor(e){this.root=e;e.updateMatrixWorld(!0),this.bounds=new mi().setFromObject(e),e.traverse(t=>{t instanceof yi&&(this.own.set(t,t.material),"isSkinnedMesh"in t||(t.raycast=wi))})}root;own=new Map;jobs=new ot;bounds;plain;numbersAsked;ownColors=new Map;middles=[];lists=new Map;static async load(e){return new n(await oo(e))}get meshes(){return[...this.own.keys()]}setShading(e){F(e)===void 0&&this.unpaint(),this.plain?.dispose();let t=e==="textured"?void 0:it(xi,e);this.plain=t;for(let[r,o]of this.own)r.material=t??o}materialNear(e){let t,r=new be;for(let[o,s]of this.own){let i=o.geometry.getAttribute("position");for(let a=0;a<i.count;a+=1){let d=r.fromBufferAttribute(i,a).applyMatrix4(o.matrixWorld).distanceToSquared(e);d<(t?.distance??Number.POSITIVE_INFINITY)&&(t={distance:d,material:Array.isArray(s)?s[0]:s})}}return t?.material}boundaryLines(){return this.jobs.boundary(this.wholeScene())}numbers(){return this.numbersAsked??=this.jobs.numbers(this.wholeScene()),this.numbersAsked}stretch(e){return this.jobs.stretch(this.wholeScene(),e)}paint(e){let t=0;for(let r of this.meshes){let{geometry:o}=r,s=t+3*o.getAttribute("position").count;this.ownColors.has(o)||this.ownColors.set(o,o.attributes.color),o.setAttribute("color",ve(e.slice(t,s))),t=s}}unpaint(){for(let[e,t]of this.ownColors)t===void 0?e.deleteAttribute("color"):e.setAttribute("color",t);this.ownColors.clear()}wholeScene(){return Ai(this.meshes.map(e=>this.whole(e,e.matrixWorld)))}async buildTrees(){for(let e of this.meshes){let t=await this.jobs.tree(this.whole(e,void 0));this.setCut(!1),e.geometry.boundsTree=gi.deserialize(t,e.geometry),this.cutAgain()}}cutOut(e){e!==this.middles&&(this.middles=e,this.cutAgain())}setCut(e){for(let[t,{whole:r,cut:o}]of this.lists)t.geometry.setIndex(e?o:r)}whole(e,t){let r=this.lists.get(e);return ki(e.geometry,r===void 0?e.geometry.index:r.whole,t)}cutAgain(){if(this.setCut(!1),this.lists.clear(),this.middles.length===0)return;let e=this.bounds.getSize(new be).length()+this.bounds.getCenter(new be).length(),t=new rt(this.middles,1e-6*e);for(let r of this.meshes){let o=r.geometry.index,s=o===null?ao(r.geometry.getAttribute("position").count):o.array,i=no(Pi(r),new Uint32Array(s),t);i!==void 0&&this.lists.set(r,{whole:o,cut:new io(i,1)})}this.setCut(!0)}pick(e){return e.firstHitOnly=!0,e.intersectObjects(this.meshes,!1)[0]}dispose(){this.jobs.stop(),this.plain?.dispose();for(let[e,t]of this.own){e.geometry.dispose();for(let r of Array.isArray(t)?t:[t])Si(r)}}};function ki(n,e,t){let r=n.getAttribute("position"),o=new Float32Array(3*r.count),s=new be;for(let a=0;a<r.count;a+=1)s.fromBufferAttribute(r,a),t!==void 0&&s.applyMatrix4(t),s.toArray(o,3*a);let i=e===null?ao(r.count):new Uint32Array(e.array);return{positions:o,triangles:i}}function Pi({geometry:n,matrixWorld:e}){let t=n.getAttribute("position"),r=new Float64Array(3*t.count),o=new be;for(let s=0;s<t.count;s+=1)o.fromBufferAttribute(t,s).applyMatrix4(e),r.set([o.x,o.y,o.z],3*s);return r}function ao(n){let e=new Uint32Array(n);for(let t=0;t<n;t+=1)e[t]=t;return e}function Ai(n){let e=i=>i.reduce((a,d)=>a+d.length,0),t=new Float32Array(e(n.map(i=>i.positions))),r=new Uint32Array(e(n.map(i=>i.triangles))),[o,s]=[0,0];for(let i of n){t.set(i.positions,o);let a=o/3;r.set(i.triangles.map(d=>d+a),s),o+=i.positions.length,s+=i.triangles.length}return{positions:t,triangles:r}}function Si(n){for(let e of Object.values(n))typeof e=="object"&&e!==null&&"isTexture"in e&&e.dispose();n.dispose()}function ve(n){return new io(n,3)}function co(n){let e=[],t=[],r=0;for(let{hole:o}of n){let{gridPositions:s=[],knownCells:i=[],chartSide:a=0}=o,d=a/64,c=new Set(i),l=h=>s.slice(3*h,3*h+3);for(let h of d>0?i:[]){let u=h%64,f=[u>0?h-1:-1,u+1<64?h+1:-1,h-64,h+64].filter(x=>c.has(x)).map(x=>$i(l(h),l(x)));f.length>0&&(e.push(...l(h)),t.push(f.reduce((x,m)=>x+m,0)/f.length/d),r=Math.max(r,1.2*d))}}return{positions:new Float32Array(e),stretch:new Float32Array(t),reach:r}}function lo({hole:n,positions:e}){let{patchFaces:t=[],patchUvs:r=[],chartSide:o=0}=n,s=e.length/3,i=new Float32Array(2*s),a=(d,c,l,h)=>{let u=0;for(let p=0;p<c;p+=1)u+=(d[c*l+p]-d[c*h+p])**2;return Math.sqrt(u)};for(let d=0;d+2<t.length&&r.length>0;d+=3)for(let c=0;c<3;c+=1){let[l,h]=[t[d+c],t[d+(c+1)%3]],u=a(r,2,l,h)*o;if(u>0)for(let p of[l,h])i[2*p]=i[2*p]+a(e,3,l,h)/u,i[2*p+1]=i[2*p+1]+1}return Float32Array.from({length:s},(d,c)=>i[2*c]/i[2*c+1])}function $i(n,e){return Math.hypot(...n.map((t,r)=>t-e[r]))}async function yo(n){let{scene:e}=await new Ci().parseAsync(n,"");e.updateMatrixWorld(!0);let t=[];return e.traverse(r=>{r instanceof mo&&t.push({geometry:r.geometry.applyMatrix4(r.matrixWorld),image:r.material.map})}),t}var at=class{constructor(e,{geometry:t,image:r},o){this.patch=e;this.image=r;let s=e.hole.id??0,i=e.dressing.positions.get(s)??e.positions,a=t.getAttribute("position");this.rim=(e.hole.rimPositions?.length??0)/3,this.corners=Ti(a.array,i),this.firstNormals=new Float32Array(t.getAttribute("normal").array);let d=po(i,e.hole.patchFaces??[]);this.sides=Float32Array.from(this.corners,(c,l)=>[0,1,2].reduce((u,p)=>u+(d[3*c+p]??0)*(this.firstNormals[3*l+p]??0),0)<0?-1:1),this.ownColors=r===null?Li(e,this.corners.length):void 0,t.setAttribute("position",ve(new Float32Array(3*this.corners.length))),t.setAttribute("normal",ve(new Float32Array(3*this.corners.length))),this.mesh=new mo(t,o),this.mesh.name=`hole ${s}`,this.unpaint(),this.update(e)}patch;mesh;image;corners;rim;firstNormals;ownColors;sides;get hole(){return this.patch.hole.id??0}get shown(){return this.patch}update(e){this.patch=e;let{geometry:t}=this.mesh,[r,o]=[t.getAttribute("position"),t.getAttribute("normal")],s=e.normals??po(e.positions,e.hole.patchFaces??[]);for(let[i,a]of this.corners.entries()){let d=this.sides[i];for(let c=0;c<3;c+=1){let l=3*i+c;r.array[l]=e.positions[3*a+c],o.array[l]=a<this.rim?this.firstNormals[l]:d*s[3*a+c]}}r.needsUpdate=!0,o.needsUpdate=!0,t.computeBoundingSphere(),t.computeBoundingBox()}heatValues(e){switch(e){case"stretch":return lo(this.patch);case"curvature":return this.numbers().curvature;case"confidence":return zn(this.patch)}}paint(e){let t=tt(this.heatValues(e.heat),this.numbers().shade,e),r=new Float32Array(3*this.corners.length);for(let[o,s]of this.corners.entries())r.set(t.subarray(3*s,3*s+3),3*o);this.mesh.geometry.setAttribute("color",ve(r))}unpaint(){let{geometry:e}=this.mesh;this.ownColors===void 0?e.deleteAttribute("color"):e.setAttribute("color",this.ownColors)}numbers(){let{positions:e,hole:t}=this.patch,r=Uint32Array.from({length:e.length/3},(o,s)=>s);return Gn(e,t.patchFaces??[],r)}pointOf(e){if(e.face===null||e.face===void 0||!se(this.patch))return;let t=[e.face.a,e.face.b,e.face.c].map(c=>this.corners[c]),[r,o,s]=t.map(c=>this.vertex(c)),i=Ei.getBarycoord(e.point,r,o,s,new uo)?.toArray();if(i===void 0)return;let a=this.patch.hole.patchUvs??[],d=[0,1].map(c=>t.reduce((l,h,u)=>l+i[u]*a[2*h+c],0));return $(this.patch,d)}dispose(){this.image?.dispose(),this.mesh.geometry.dispose()}vertex(e){return new uo().fromArray(this.patch.positions,3*e)}};function Ti(n,e){let t=(o,s)=>o.subarray(3*s,3*s+3).join(),r=new Map;for(let o=0;o<e.length/3;o+=1)r.set(t(e,o),o);return Uint32Array.from({length:n.length/3},(o,s)=>r.get(t(n,s))??Di(e,n.subarray(3*s,3*s+3)))}function Di(n,e){let t={vertex:0,distance:Number.POSITIVE_INFINITY};for(let r=0;r<n.length/3;r+=1){let o=[0,1,2].reduce((s,i)=>s+(n[3*r+i]-e[i])**2,0);o<t.distance&&(t={vertex:r,distance:o})}return t.vertex}function Li({hole:n,dressing:e},t){let r=Float32Array.from(n.surface?.colors??[]),o=n.id??0;if(!(e.colours.has(o)||t===0||r.length!==4*t)){if(e.textures.get(o)?.method==="flat"){let s=[0,1,2,3].map(i=>r.reduce((a,d,c)=>c%4===i?a+d:a,0)/t);return new ho(r.map((i,a)=>s[a%4]),4)}return new ho(r,4)}}function po(n,e){let t=new Float32Array(n.length),r=(o,s)=>n[3*o+s];for(let o=0;o+2<e.length;o+=3){let[s,i,a]=[e[o],e[o+1],e[o+2]],[d,c,l]=[r(i,0)-r(s,0),r(i,1)-r(s,1),r(i,2)-r(s,2)],[h,u,p]=[r(a,0)-r(s,0),r(a,1)-r(s,1),r(a,2)-r(s,2)];for(let f of[s,i,a])t[3*f]=t[3*f]+c*p-l*u,t[3*f+1]=t[3*f+1]+l*h-d*p,t[3*f+2]=t[3*f+2]+d*u-c*h}for(let o=0;o<t.length;o+=3){let s=t.subarray(o,o+3),i=Math.hypot(...s)||1;s.forEach((a,d)=>s[d]=a/i)}return t}var go=15770462;function bo({color:n,roughness:e,metalness:t}){return new cr({color:new Mi(...n),roughness:e,metalness:t,side:fo})}function vo(n,e){if(e!==null){let{roughness:t=.9,metalness:r=0}=n??{};return new cr({map:e,roughness:t,metalness:r,side:fo})}return n?.clone()??new cr({color:12172998})}import{Box3 as Ri,Group as Oi,Line2 as Fi,LineGeometry as Bi,LineMaterial as Ni,Vector3 as hr}from"./vendor.js";var lr={chosen:4,other:2},dt=class{group=new Oi;lines=new Map;views=new Map;edges;vertices;constructor(e,t,r){let o=e.flatMap(s=>{let i=t.get(s.id??0);return i===void 0?[]:[{loop:s,line:i}]});this.edges=o.map(({loop:s,line:i})=>new Je(i,s)),this.vertices=o.flatMap(({line:s})=>wo(s));for(let{loop:s,line:i}of o){let a=J(s.kind??""),d=r*(a.line==="dotted"?.003:.012),c=new Ni({color:a.color,linewidth:lr.other,dashed:a.line!=="solid",dashSize:d,gapSize:a.line==="dotted"?2*d:.7*d}),l=new Bi;l.setPositions([...i.points,...i.points.subarray(0,3)]);let h=new Fi(l,c);h.computeLineDistances(),this.lines.set(s.id??0,h),this.views.set(s.id??0,Ii(i,s.kind)),this.group.add(h)}}choose(e){for(let[t,r]of this.lines)r.material.linewidth=e.has(t)?lr.chosen:lr.other}setVisible(e){this.group.visible=e}viewOf(e){return this.views.get(e)}dispose(){for(let e of this.lines.values())e.geometry.dispose(),e.material.dispose()}};function wo({points:n}){return Array.from({length:n.length/3},(e,t)=>new hr().fromArray(n,3*t))}function Ii(n,e){let t=wo(n),r=new Ri().setFromPoints(t),o=r.getCenter(new hr),s=new hr;return t.forEach((i,a)=>{let d=t[(a+1)%t.length];s.add(i.clone().sub(o).cross(d.clone().sub(o)))}),{bounds:r,front:e==="HOLE"?s.negate().normalize():s.normalize()}}import{OrbitControls as Vi,PerspectiveCamera as Hi,Scene as Ui,Sphere as xo,WebGLRenderer as ji}from"./vendor.js";var we=class{constructor(e){this.ways=e}ways;chosen=0;times=[];get way(){return this.chosen}took(e){this.times=[...this.times,e].slice(-5);let t=this.times.toSorted((r,o)=>r-o)[4/2];this.times.length<5||t===void 0||(t>20&&this.chosen+1<this.ways?this.go(this.chosen+1):t<8&&this.chosen>0&&this.go(this.chosen-1))}go(e){this.chosen=e,this.times=[]}};var $o=[1,.7,.5,.35],Mo=[1,1,.7,.5,.35],ko=250,Po=2,ct=class{constructor(e,t){this.host=e;this.drawn=t;this.renderer=new ji({antialias:!0,alpha:!0}),this.renderer.setPixelRatio(So()),Yt(this.camera),this.canvas.tabIndex=0,e.append(this.canvas),this.controls=new Vi(this.camera,this.canvas),this.controls.enableDamping=!1,this.controls.addEventListener("change",()=>this.draw()),this.resized=new ResizeObserver(()=>this.resize()),this.resized.observe(e),this.canvas.addEventListener("webglcontextrestored",()=>this.draw())}host;drawn;scene=new Ui;camera=new Hi(35,1,.01,100);controls;renderer;stays=new qe(this.scene);resized;paces=Ao();sphere;forgetFrame;change;finishedAt=Number.NEGATIVE_INFINITY;inFlight=0;isFull=!0;stillTimer;laterTimer;get canvas(){return this.renderer.domElement}get rendererName(){let e=this.renderer.getContext(),t=e.getExtension("WEBGL_debug_renderer_info");return String(e.getParameter(t?.UNMASKED_RENDERER_WEBGL??e.RENDERER))}get isStill(){return this.change===void 0&&this.inFlight===0&&this.isFull}draw(e="all"){if(this.change=this.change==="all"?"all":e,clearTimeout(this.laterTimer),this.laterTimer=void 0,this.forgetFrame===void 0)if(e==="cloth"&&this.paces.cloth.way>0){let t=setTimeout(this.drawAsked);this.forgetFrame=()=>clearTimeout(t)}else{let t=requestAnimationFrame(this.drawAsked);this.forgetFrame=()=>cancelAnimationFrame(t)}}drawAsked=()=>{this.forgetFrame=void 0,this.change!==void 0&&this.inFlight<(this.isSlow?1:2)&&this.drawFrame(this.change)};get isSlow(){return this.paces.camera.way+this.paces.cloth.way>0}drawMarks(e){e===0||this.paces.cloth.way===0||this.change!==void 0?this.draw("cloth"):this.laterTimer??=setTimeout(()=>this.draw("cloth"),e)}setBounds(e){this.sphere=e?.getBoundingSphere(new xo),this.paces=Ao()}lookAt(e,t){let{center:r,radius:o}=e.getBoundingSphere(new xo);if(e.isEmpty()||!(o>0))return;let s=Math.min(1,this.camera.aspect),i=1.1*o/Math.sin(this.camera.fov*Math.PI/360)/s,a=t.lengthSq()>0?t.clone():this.camera.position.clone().sub(this.controls.target);this.controls.target.copy(r),this.camera.position.copy(r).addScaledVector(a.normalize(),i),this.fitDepth(),this.controls.update(),this.draw()}pivotAt(e){this.controls.target.copy(e),this.controls.update(),this.draw()}async picture(){this.setShare(1),this.drawNow();let e=await new Promise(t=>this.canvas.toBlob(t,"image/png"));if(e===null)throw new Error("The browser made no picture.");return e}drawNow(){this.stays.forget(),this.fit();let{clientWidth:e,clientHeight:t}=this.host,{before:r,split:o}=this.drawn.look(),s=Math.round(o*e);this.renderer.setScissorTest(s>0),this.renderer.setScissor(s,0,e-s,t),this.drawPart(!r),s>0&&(this.renderer.setScissor(0,0,s,t),this.drawPart(!1))}dispose(){this.forgetFrame?.(),clearTimeout(this.stillTimer),clearTimeout(this.laterTimer),this.resized.disconnect(),this.controls.dispose(),this.stays.dispose(),this.renderer.dispose(),this.canvas.remove()}drawFrame(e){let t=this.inFlight>0||performance.now()-this.finishedAt<ko;if(this.change=void 0,clearTimeout(this.stillTimer),!t){this.setShare(1),this.drawNow(),this.whenDrawn(()=>{});return}let{before:r,split:o}=this.drawn.look(),s=e==="cloth"&&o===0&&!r,i=s?this.paces.cloth:this.paces.camera;this.setShare((s?Mo:$o)[i.way]??1);let a=!0;s&&i.way>0?(this.fit(),this.renderer.setScissorTest(!1),a=this.stays.draw(this.renderer,this.camera),this.isFull=!1):this.drawNow(),this.whenDrawn(d=>a&&i.took(d))}drawStill(){this.change===void 0&&!this.isFull&&(this.finishedAt=Number.NEGATIVE_INFINITY,this.draw())}whenDrawn(e){let t=this.renderer.getContext(),r=performance.now(),o=t.fenceSync(t.SYNC_GPU_COMMANDS_COMPLETE,0);t.flush(),this.inFlight+=1;let s=()=>{if(o!==null&&t.clientWaitSync(o,0,0)===t.TIMEOUT_EXPIRED){setTimeout(s,Po);return}t.deleteSync(o),this.inFlight-=1,this.finishedAt=performance.now(),e(this.finishedAt-r),this.change!==void 0?this.draw(this.change):this.isFull||(clearTimeout(this.stillTimer),this.stillTimer=setTimeout(()=>this.drawStill(),ko))};setTimeout(s,Po)}setShare(e){let t=e*So();this.isFull=e===1,this.renderer.getPixelRatio()!==t&&this.renderer.setPixelRatio(t)}fit(){this.fitDepth(),this.drawn.fit(this.host.clientHeight)}drawPart(e){this.drawn.arrange(e),this.renderer.render(this.scene,this.camera),this.drawn.arrange(!0)}fitDepth(){if(this.sphere!==void 0){let{center:e,radius:t}=this.sphere,r=this.camera.position.distanceTo(e);this.camera.far=r+4*t,this.camera.near=Math.max(r-4*t,this.camera.far/5e3),this.camera.updateProjectionMatrix()}}resize(){let{clientWidth:e,clientHeight:t}=this.host;e>0&&t>0&&(this.renderer.setSize(e,t),this.camera.aspect=e/t,this.camera.updateProjectionMatrix(),this.setShare(1),this.drawNow())}};function Ao(){return{camera:new we($o.length),cloth:new we(Mo.length)}}function So(){return Math.min(devicePixelRatio,2)}var ur={shading:"textured",tinted:!0,outlined:!0,before:!1,split:0},ht=class{marks=new Ze;aim;screen;scan;rims;patches=[];heat;stretch;onHeat=()=>{};onError=()=>{};wanted=[];look=ur;chosen;cutFaces=[];constructor(e){this.screen=new ct(e,{look:()=>this.look,arrange:i=>{this.patches.forEach(({mesh:a})=>a.visible=i),this.scan?.setCut(i)},fit:i=>this.marks.fit(r,i)});let{scene:t,camera:r}=this.screen;this.aim=new Ke(this.canvas,r);let o=new Wi(16777215,1.9);o.position.set(1,1.2,.9),r.add(o);let s=new Gi(16777215,9279397,1);for(let i of[o,s])i.layers.enable(E);t.add(r,s,this.marks.group)}get canvas(){return this.screen.canvas}get camera(){return this.screen.camera}get controls(){return this.screen.controls}get rendererName(){return this.screen.rendererName}get isStill(){return this.screen.isStill}async showScan(e,t){let r=await st.load(e.slice(0));this.clear(),this.scan=r,this.screen.scene.add(r.root),this.screen.setBounds(r.bounds),r.setShading(this.shading),this.renewHeat();let o=r.bounds.getBoundingSphere(new zi);this.screen.lookAt(r.bounds,new lt(.5,.5,1));let s=await r.boundaryLines();if(this.scan!==r)return;this.rims=new dt(t,On(t,s),o.radius||1),this.rims.setVisible(this.look.outlined),this.rims.choose(this.chosen??new Set),this.screen.scene.add(this.rims.group);let i=Y(t)[0]?.[1][0]?.id??0;this.screen.lookAt(r.bounds,this.rims.viewOf(i)?.front??new lt(.5,.5,1)),r.buildTrees().catch(()=>{})}chooseLoops(e){e!==this.chosen&&(this.chosen=e,this.rims?.choose(e),this.draw())}async showPatches(e){this.wanted=e;let t=e[0]?.dressing;if(!this.showsSurfacesOf(e)){let o=t===void 0?[]:await yo(t.glb.slice(0));if(this.wanted[0]?.dressing!==t)return;this.showsSurfacesOf(this.wanted)||(this.replacePatches(o),this.renewHeat(),this.draw())}this.wanted.filter((o,s)=>this.move(o,this.patches[s])).length>0&&this.screen.draw("cloth")}move(e,t){return t===void 0||t.shown===e?!1:(t.update(e),this.heat!==void 0&&t.paint(this.heat),!0)}mark(e,t){this.marks.show(e)&&this.screen.drawMarks(t)}showCut(e){e!==this.cutFaces&&(this.cutFaces=e,this.scan?.cutOut(e),this.draw())}nearestOfBorder(e,t){return this.aim.nearestOf(this.rims?.vertices??[],{x:e,y:t},40)?.clone()}borderLines(e){return Dn(this.rims?.edges??[],e)}setLook(e){let t=this.look;this.look={...t,...e},this.rims?.setVisible(this.look.outlined),t.shading!==this.look.shading&&this.renewHeat(),(t.shading!==this.look.shading||t.tinted!==this.look.tinted)&&this.renewMaterials(),this.draw()}renewMaterials(){this.scan?.setShading(this.shading);for(let e of this.patches)e.mesh.material.dispose(),e.mesh.material=this.materialOf(e.shown,e.image),F(this.shading)===void 0&&e.unpaint()}get shading(){let{shading:e}=this.look;return F(e)===void 0||this.heat?.heat===e?e:"shaded"}renewHeat(){let{scan:e}=this;this.showHeat().catch(t=>{this.scan===e&&this.onError(t)})}async showHeat(){let{scan:e,look:t,patches:r}=this,o=F(t.shading);if(o===void 0||e===void 0){this.heat=void 0,this.onHeat(o,void 0);return}this.onHeat(o,this.heat?.heat===o?this.heat:void 0);let[{shade:s},i]=await Promise.all([e.numbers(),this.heatOfScan(o,e)]);if(this.scan!==e||F(this.look.shading)!==o||this.patches!==r)return;let a=r.map(d=>d.heatValues(o));this.heat=to(o,i===void 0?a:[i,...a]),e.paint(i===void 0?Qn(s):tt(i,s,this.heat));for(let d of r)d.paint(this.heat);this.renewMaterials(),this.onHeat(o,this.heat),this.draw()}async heatOfScan(e,t){if(e==="confidence")return;if(e==="curvature")return(await t.numbers()).curvature;let r=this.wanted[0]?.dressing;return(this.stretch===void 0||this.stretch.dressing!==r)&&(this.stretch={dressing:r,values:t.stretch(co(this.wanted))}),this.stretch.values}frame(e){let t=e===void 0?void 0:this.rims?.viewOf(e);this.screen.lookAt(t?.bounds??this.scan?.bounds??new _i,t?.front??new lt)}pivotAt(e){this.screen.pivotAt(e)}pick(e,t){let r=this.aim.at(e,t),o=this.look.before?[]:this.patches,s=r.intersectObjects(o.map(({mesh:a})=>a),!1)[0],i=this.scan?.pick(r);if(s!==void 0&&s.distance<=(i?.distance??Number.POSITIVE_INFINITY)){let a=this.patches.find(({mesh:d})=>d===s.object);return{position:s.point,cloth:a?.pointOf(s),onPatch:!0}}return i&&{position:i.point,cloth:void 0,onPatch:!1}}draw(){this.screen.draw()}picture(){return this.screen.picture()}dispose(){this.clear(),this.screen.dispose()}materialOf({hole:e,dressing:t},r){let{shading:o}=this,{tinted:s}=this.look;if(s&&F(o)===void 0)return it(go,o);if(o!=="textured")return it(12172998,o);let i=t.colours.get(e.id??0);if(i!==void 0)return bo(i);let a=this.scan?.materialNear(new lt().fromArray(e.rimPositions??[0,0,0]));return vo(a,r)}clear(){this.clearPatches(),this.marks.clear(),this.scan!==void 0&&(this.screen.scene.remove(this.scan.root),this.scan.dispose()),this.rims!==void 0&&(this.screen.scene.remove(this.rims.group),this.rims.dispose()),this.scan=void 0,this.heat=void 0,this.stretch=void 0,this.rims=void 0,this.cutFaces=[]}showsSurfacesOf(e){let t=(r,o)=>this.patches[o]?.shown.dressing===r.dressing;return e.length===this.patches.length&&e.every(t)}replacePatches(e){this.clearPatches(),this.wanted.forEach((t,r)=>{let o=e[r];if(o!==void 0){let s=new at(t,o,this.materialOf(t,o.image));this.heat!==void 0&&s.paint(this.heat),this.patches.push(s),s.mesh.layers.set(E),this.screen.scene.add(s.mesh)}})}clearPatches(){for(let e of this.patches)this.screen.scene.remove(e.mesh),e.mesh.material.dispose(),e.dispose();this.patches=[]}};import{LitElement as Wa,css as Ga,html as ne,nothing as Tr}from"./vendor.js";function W(n,e){let t=document.createElement("a");t.href=URL.createObjectURL(n),t.download=e,t.click(),setTimeout(()=>URL.revokeObjectURL(t.href),6e4)}import{css as Qi,html as xe,nothing as C,svg as ke}from"./vendor.js";import{svg as qi}from"./vendor.js";var pr=64,ut=[[253,231,37],[53,183,121],[49,104,142],[68,1,84]];function Co(n){let e=n.filter(t=>t!==null&&Number.isFinite(t));return e.length===0?void 0:{least:e.reduce((t,r)=>Math.min(t,r)),most:e.reduce((t,r)=>Math.max(t,r))}}function Eo(n,{least:e,most:t},r){let o=r/pr,s=Math.max(t*1e-6,Number.MIN_VALUE),i=c=>Math.log(c+s),[a,d]=[i(e),i(t)];return n.flatMap((c,l)=>{if(c===null||!Number.isFinite(c))return[];let[h,u]=[l%pr,Math.floor(l/pr)],p=Ki(d>a?(i(c)-a)/(d-a):0);return[qi`<rect x=${h*o} y=${r-(u+1)*o} width=${o} height=${o} shape-rendering="crispEdges" fill=${p} />`]})}function Ki(n){let e=Math.min(Math.max(n,0),1)*(ut.length-1),t=Math.min(Math.floor(e),ut.length-2),[r,o]=[ut[t],ut[t+1]];return`rgb(${r.map((i,a)=>Math.round(i+(o[a]-i)*(e-t))).join()})`}import{LitElement as Yi,css as Xi}from"./vendor.js";import{css as Ji}from"./vendor.js";var te=Ji`
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
`;var y=class extends Yi{static styles=[te,Xi`
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
    `];editor;changed=()=>this.requestUpdate();connectedCallback(){super.connectedCallback(),this.editor.addEventListener("change",this.changed)}disconnectedCallback(){super.disconnectedCallback(),this.editor.removeEventListener("change",this.changed)}};var G=256,pt=64,To={whole:1/pt,fine:1/(4*pt)},Zi=new Map([["ArrowLeft",[-1,0]],["ArrowRight",[1,0]],["ArrowDown",[0,-1]],["ArrowUp",[0,1]]]),fr=class extends y{static styles=[y.styles,Qi`
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
    `].flat();held;render(){let{draft:e,found:t,editable:r}=this.editor,s=(e===void 0||M(e)?void 0:e.hole)??t?.hole??r[0]?.hole.id,i=r.find(f=>f.hole.id===s);if(i===void 0||s===void 0)return C;let a=t!==void 0&&t.hole===s?t.found:void 0,d=i.hole.chartPng,c=this.editor.tool==="anchor"&&this.editor.map?.hole===s?this.editor.map.losses:[],l=Co(c),h=(a?.path??[]).map(({cell:f})=>ra(f??[])),[u,p]=[this.dots(s),this.gestures(s)];return xe`
      <h2>Chart of hole ${s}</h2>
      <svg viewBox="0 0 ${G} ${G}" role="group" aria-label=${this.words(s)}>
        ${d?ke`<image href="data:image/png;base64,${d}" width=${G} height=${G} />`:C}
        ${l?Eo(c,l,G):C}
        ${h.length>1?ke`<polyline points=${h.map(f=>ft(f).join()).join(" ")} fill="none" stroke="#0b7285" stroke-width="2" />`:C}
        ${p.map(f=>Do(f,"#ffffff"))}
        ${e?na(e).map(f=>Do(f,"#22b8cf")):C}
        ${a?.uv?ta(a.uv):C} ${u.map(f=>this.anchorDot(f,i))}
      </svg>
      ${a!==void 0||u.length+p.length>0?xe`<p class="quiet small">White: gestures; yellow: anchors; the cross: where the last search ended.</p>`:C}
      ${u.length>0?xe`<p class="quiet small">
              Drag a dot to choose which place of the cloth goes to its point; the arrow keys move it, too, Enter keeps
              it.
            </p>`:C}
      ${l?xe`<p class="small">
              The map: light where the loss is least (${g(l.least)}), dark where it is largest
              (${g(l.most)}).
            </p>`:C}
      ${a?xe`<p class="small">
              The point belongs at u ${a.uv?.[0]?.toFixed(3)}, v ${a.uv?.[1]?.toFixed(3)}; the search went
              through ${h.length} ${h.length===1?"cell":"cells"}.
            </p>`:C}
    `}dots(e){let{draft:t,found:r,step:o}=this.editor,s=t?.kind==="anchor"&&t.hole===e?t:void 0,i=o.constraints.anchors.flatMap((d,c)=>{let l=s?.replaces===c?s:void 0,h=l?.uv??d.uv;return(d.hole===void 0||d.hole===e)&&h?.length===2?[ea(d,{index:c,hole:e,uv:h,draft:l})]:[]}),a=s?.uv??(r?.hole===e?r.found.uv:void 0);return s===void 0||s.replaces!==void 0||a===void 0?i:[...i,{name:"New anchor",uv:a,at:d=>({...s,uv:d})}]}anchorDot(e,t){let[r,o]=ft(e.uv),[s,i]=e.uv,a=`u ${s.toFixed(3)}, v ${i.toFixed(3)}`;return ke`
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
        <circle class="focus" cx=${r} cy=${o} r="11" />
        <circle class="ring" cx=${r} cy=${o} r="6" fill="#ffd43b" stroke="#1c2026" stroke-width="2" />
      </g>
    `}down(e,{uv:t}){e.button!==0||!e.isPrimary||this.editor.work!==void 0||(e.currentTarget.setPointerCapture(e.pointerId),this.held={pointer:e.pointerId,x:e.clientX,y:e.clientY,uv:t,moved:!1})}move(e,t,r){let o=this.renderRoot.querySelector("svg")?.getBoundingClientRect();if(this.held?.pointer!==e.pointerId||o===void 0)return;this.held.moved=!0;let{x:s,y:i,uv:a}=this.held;this.put(t,[a[0]+(e.clientX-s)/o.width,a[1]-(e.clientY-i)/o.height],r)}up=e=>{let{held:t}=this;this.held=void 0,t?.pointer===e.pointerId&&t.moved&&this.editor.draft?.kind==="anchor"&&this.editor.commit()};cancel=()=>{this.held=void 0,this.editor.dropDraft()};key(e,t,r){let o=Zi.get(e.key),{draft:s,work:i}=this.editor;if(i===void 0)if(o!==void 0){e.preventDefault();let a=e.shiftKey?To.fine:To.whole;this.put(t,[t.uv[0]+a*o[0],t.uv[1]+a*o[1]],r)}else e.key==="Enter"&&s?.kind==="anchor"&&s.uv!==void 0?(e.preventDefault(),this.editor.commit()):e.key==="Escape"&&this.cancel()}put(e,t,r){if($(r,t)===void 0)return;let o=e.at(t);this.editor.tool!=="anchor"&&this.editor.setTool("anchor"),this.editor.preview(o)}gestures(e){let t=o=>o.hole===void 0||o.hole===e;return this.editor.step.constraints.edits.filter(t).flatMap(({grab:o,twist:s,pinch:i})=>[o?.uv,s?.uv,...i?.uvs??[]]).filter(o=>o?.length===2)}words(e){let t=this.gestures(e).length+this.dots(e).length;return`The cloth around hole ${e}, laid flat, with ${t} ${t===1?"place":"places"} of constraints.`}};function ea({position:n,hard:e=!1},{index:t,hole:r,uv:o,draft:s}){let[i=0,a=0,d=0]=n??[],c=s??{kind:"anchor",hole:r,position:[i,a,d],hard:e,replaces:t};return{name:`Anchor ${t+1}`,uv:o,at:l=>({...c,uv:l})}}function ft([n,e]){return[n*G,(1-e)*G]}function Do(n,e){let[t,r]=ft(n);return ke`<circle cx=${t} cy=${r} r="5" fill=${e} stroke="#1c2026" stroke-width="1.5" />`}function ta(n){let[e,t]=ft(n),r=`M${e-8},${t}H${e+8}M${e},${t-8}V${t+8}`;return ke`<path d=${r} stroke="#1c2026" stroke-width="4" /><path d=${r} stroke="#ffd43b" stroke-width="2" />`}function ra([n=0,e=0]){return[(n+.5)/pt,(e+.5)/pt]}function na(n){switch(n.kind){case"grab":case"twist":return[n.uv];case"pinch":return n.uvs;case"anchor":case"cut":case"polygon":case"border":return[]}}customElements.define("darn-chart",fr);import{html as oa}from"./vendor.js";var mr=class extends y{render(){let{work:e}=this.editor,t=e!==void 0;return oa`
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
`],{type:"application/json"});W(e,`${ee(this.editor.scan?.name)}.constraints.json`)};pick=()=>this.renderRoot.querySelector("input[type=file]")?.click();picked=async e=>{let t=e.target,r=await t.files?.[0]?.text();t.value="",r!==void 0&&await this.editor.loadConstraints(r)}};customElements.define("darn-constraints",mr);import{css as ca,html as k,nothing as B,svg as la}from"./vendor.js";import{css as sa,html as yr,nothing as ia}from"./vendor.js";var gr=class extends y{static styles=[y.styles,sa`
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
    `].flat();render(){let{editor:e}=this,{step:t,alternative:r,canVary:o}=e,s=Vt(t.constraints.alternative,t.report),i=(a,d,c)=>yr`
      <button
        aria-label=${d}
        ?disabled=${!o}
        aria-disabled=${c<0||c>=8}
        @click=${()=>{e.chooseFill(c)}}
      >
        ${a}
      </button>
    `;return yr`
      <div class="row" role="group" aria-label="Fills">
        ${i("\u2039","Previous fill",r-1)}
        <span class=${o?"":"quiet"}>${L(r)}</span>
        ${i("\u203A","Next fill",r+1)}
      </div>
      ${s===void 0?ia:yr`<p class="small">${s}</p>`}
    `}};customElements.define("darn-fill",gr);import{css as aa,html as br,nothing as da}from"./vendor.js";var vr=class extends y{static styles=[y.styles,aa`
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
    `].flat();render(){let{canVary:e,texture:t,scan:r}=this.editor,o=r!==void 0&&Ue(r.document),s=[[void 0,Ht],...X];return br`
      <label>
        Colour of the new cloth
        <select ?disabled=${!e||!o} @change=${this.choose}>
          ${s.map(([i,a])=>br` <option value=${i??""} .selected=${i===t}>${a}</option> `)}
        </select>
      </label>
      ${o?da:br`<p class="quiet small">
              This scan has neither images nor colours of vertices: the new cloth has its material.
            </p>`}
    `}choose=e=>{let{value:t}=e.target;this.dispatchEvent(new CustomEvent("darn-look",{detail:{tinted:!1},bubbles:!0,composed:!0})),this.editor.vary({texture:t===""?void 0:t})}};customElements.define("darn-texture",vr);var wr=class extends y{static styles=[y.styles,ca`
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
        gap: 0 8px;
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
      li.place {
        grid-template-columns: 1fr auto auto;
      }
      li .name {
        padding: 0 10px;
      }
      li button.own {
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
    `].flat();lastClicked;render(){let{scan:e,chosen:t,work:r,step:o}=this.editor,s=e?.loops??[],i=s.filter(A).map(a=>a.id??0);return k`
      <h2>Holes</h2>
      ${i.length===0?k`<p>${pa(s,e?.candidates??[])}</p>`:B}
      ${Y(s).map(([a,d])=>this.group(a,d))} ${this.candidates()} ${this.made()}
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
      ${o.patches.length===0?B:k`<darn-fill .editor=${this.editor}></darn-fill> <darn-texture .editor=${this.editor}></darn-texture>`}
    `}get isNew(){let{chosen:e,step:t,scan:r,acceptDoubtful:o}=this.editor,s=t.holes.filter(a=>r?.loops.some(d=>d.id===a));return!(e.size===s.length&&s.every(a=>e.has(a)))||o!==t.acceptDoubtful}doubtful(){let{skipped:e,acceptDoubtful:t,isRefusedAsDoubtful:r}=this.editor;return!t&&!r&&!e.some(({code:s})=>s==="no_plausible_fill")?B:k`
      <label class="doubtful">
        <input type="checkbox" .checked=${t} @change=${s=>this.editor.setAcceptDoubtful(s.target.checked)} />
        ${zt}
      </label>
    `}candidates(){let e=this.editor.scan?.candidates??[];return e.length===0?B:k`
      <h3>Bites, rips and tears at the border (${e.length})</h3>
      <ul aria-label="Bites, rips and tears at the border">
        ${e.map((t,r)=>this.candidate(t,r))}
      </ul>
    `}candidate(e,t){let{step:r,work:o}=this.editor,s=e.border?.facing!==void 0,i=`${ua(e)} ${t+1}`,a=s?`${g(e.length)} long`:`${g(e.depth)} deep`,d=$t(e,r.made),c=Se(e),l=()=>{this.editor.setTool("border"),this.editor.preview(c)},h=()=>{this.editor.make("Border",ae(c))};return k`
      <li class="place">
        <button ?disabled=${d} @click=${l}>${i}${d?" \u2713 mended":""}</button>
        <span class="quiet small">${g(e.mouth)} wide · ${a}</span>
        ${d?B:k`<button class="own" ?disabled=${o!==void 0} aria-label="Mend ${i}" @click=${h}>
                Mend
              </button>`}
      </li>
    `}made(){let{step:e,work:t}=this.editor;return e.made.length===0?B:k`
      <h3>Cut out and borders (${e.made.length})</h3>
      <ul aria-label="Cut out and borders">
        ${e.made.map((r,o)=>k`
            <li class="other">
              <span class="name">${Lo(r)} ✓ mended</span>
              <button
                class="own"
                ?disabled=${t!==void 0}
                aria-label="Put back ${o+1}: ${Lo(r)}"
                @click=${()=>{this.editor.unmake(r)}}
              >
                Put back
              </button>
            </li>
          `)}
      </ul>
    `}group(e,t){let r=J(e),o={solid:"",dashed:"7 4",dotted:"2 4"}[r.line],s=la`<svg width="30" height="8" aria-hidden="true">
      <line x1="0" y1="4" x2="30" y2="4" stroke=${r.color} stroke-width="3" stroke-dasharray=${o} />
    </svg>`;return k`
      <h3>${s}${r.plural} (${t.length})</h3>
      <ul aria-label=${r.plural}>
        ${t.map(i=>this.item(i,t))}
      </ul>
    `}item(e,t){let r=e.id??0,{step:o,skipped:s,chosen:i}=this.editor,a=o.holes.includes(r),d=Gt(s).find(h=>h.id===r),c=a?this.editor.reportOf(r)?.doubts??[]:[],l=`${J(e.kind??"").singular} ${r}`;return k`
      <li>
        ${Pt(e)?k`<input
                type="checkbox"
                aria-label="Choose ${l}"
                .checked=${i.has(r)}
                @click=${h=>this.toggle(h,r,t)}
              />`:k`<span></span>`}
        <button @click=${()=>this.frame(r)} aria-label="Show ${l}, length ${g(e.length)}">
          ${l}${a?" \u2713 mended":""}
        </button>
        <span class="quiet small">${g(e.length)} long · ${e.vertices} vertices</span>
        ${ha(e)} ${d?k`<span class="why quiet small">${cn(d)}</span>`:B}
        ${c.map(h=>k`<span class="why quiet small">Doubtful: ${h}.</span>`)}
      </li>
    `}toggle(e,t,r){let o=r.map(l=>l.id??0),s=new Set(this.editor.chosen),[i,a]=[o.indexOf(this.lastClicked??t),o.indexOf(t)],d=e.shiftKey&&i>=0?o.slice(Math.min(i,a),Math.max(i,a)+1):[t],c=e.target.checked;for(let l of d)c?s.add(l):s.delete(l);this.lastClicked=t,this.editor.choose(s)}frame(e){this.dispatchEvent(new CustomEvent("darn-frame",{detail:e,bubbles:!0,composed:!0}))}mend=()=>{this.editor.mend()}};function Lo(n){if("border"in n){let o=n.border.facing?"Tear":"Part of the border";return n.border.auto?"All bites, rips and torn corners":o}let{radius:e,loops:t,polygon:r}=n.cut;return e!==void 0?`Ball of radius ${g(e)}`:r!==void 0?`Polygon of ${r.length} corners`:`Edge of ${(t??[]).map(o=>`hole ${o}`).join(", ")}`}function ha({kind:n="LOOP_KIND_UNSPECIFIED",confidence:e=0,evidence:t=[]}){if(t.length===0)return B;let r=n==="HOLE"?-1:1,o=[...t].sort((i,a)=>r*((a.weight??0)-(i.weight??0))),s=({weight:i=0,reason:a})=>r*i<0?`But ${a}`:`As ${a}`;return k`
    <details class="why quiet small">
      <summary>${Math.round(e*100)} % sure that it is ${Br(n)}</summary>
      ${o.map(i=>k`<p>${s(i)}</p>`)}
    </details>
  `}function ua({border:n}){return n?.facing!==void 0?"Tear":(n?.along??[]).length>0?"Torn corner":"Bite or rip"}function pa(n,e){return["This scan has no holes.",...n.some(Pt)?["An opening or an end of a sleeve is filled when you choose it."]:[],...e.length>0?["What is bitten or torn at its border is listed below."]:[]].join(" ")}customElements.define("darn-holes",wr);import{LitElement as fa,css as ma,html as ya}from"./vendor.js";var mt=class{name;constructor(e){this.name=`darn key ${e.href}`}get kept(){try{return sessionStorage.getItem(this.name)??void 0}catch{return}}keep(e){try{e===void 0?sessionStorage.removeItem(this.name):sessionStorage.setItem(this.name,e)}catch{}}},xr=class extends fa{static styles=[te,ma`
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
    `];answer;ask(){return this.settle(void 0),this.field.value="",this.dialog.showModal(),new Promise(e=>this.answer=e)}render(){return ya`
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
    `}get dialog(){return this.renderRoot.querySelector("dialog")}get field(){return this.renderRoot.querySelector("input")}submit=e=>{e.preventDefault(),this.settle(this.field.value.trim())};settle(e){let{answer:t}=this;this.answer=void 0,this.field.value="",this.dialog.close(),t?.(e)}};customElements.define("darn-key",xr);import{html as kr}from"./vendor.js";var ga=[["textured","Textured"],["shaded","Shaded"],["wireframe","Wireframe"],["stretch","Stretch"],["curvature","Curvature"],["confidence","Confidence"]],Pr=class extends y{static properties={shown:{}};render(){return kr`
      <h2>Look</h2>
      <fieldset>
        <legend class="quiet small">Surface</legend>
        <div class="row">
          ${ga.map(([e,t])=>kr`
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
    `}check(e,t){let r=o=>this.look({[t]:o.target.checked});return kr`<label class="choice"
      ><input type="checkbox" .checked=${this.shown[t]} @change=${r} />${e}</label
    >`}look(e){this.dispatchEvent(new CustomEvent("darn-look",{detail:e,bubbles:!0,composed:!0}))}};customElements.define("darn-look",Pr);import{css as ba,html as re,nothing as va}from"./vendor.js";var Ar=class extends y{static styles=[y.styles,ba`
      .hole {
        margin-bottom: 0.75rem;
      }
      .hole p {
        margin: 0;
      }
    `].flat();render(){let{report:e}=this.editor.step,t=[...this.editor.scan?.notes??[],...e?.notes??[]];return e===void 0?t.length===0?va:re`<h2>Notes</h2>
            ${t.map(r=>re`<p>${r}</p>`)}`:re`
      <h2>Report</h2>
      <p>${hn(e)}</p>
      ${[...new Set(t)].map(r=>re`<p>${r}</p>`)}
      ${(e.holes??[]).map(r=>re`<div class="hole">${ln(r).map(o=>re`<p>${o}</p>`)}</div>`)}
      <button
        @click=${()=>W(new Blob([JSON.stringify(e,void 0,2)]),`${ee(this.editor.scan?.name)}.report.json`)}
      >
        Save the report
      </button>
    `}};customElements.define("darn-report",Ar);import{html as yt,nothing as wa}from"./vendor.js";var Sr=class extends y{static properties={look:{}};render(){return yt`
      <h2>Save</h2>
      ${this.editor.step.holes.length>0?this.looks():wa}
      <button @click=${()=>this.tell("darn-picture")}>Save a picture</button>
    `}looks(){return yt`
      <fieldset>
        <legend class="quiet small">New cloth in the saved scan</legend>
        ${ze.map(([e,,t])=>yt`
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
          ${ze.map(([,e],t)=>yt`${t>0?" and ":""}“${e}”`)}.
        </p>
      </fieldset>
    `}tell(e,t){this.dispatchEvent(new CustomEvent(e,{detail:t,bubbles:!0,composed:!0}))}};customElements.define("darn-save",Sr);var N={turn:Math.PI/36,move:24,zoom:.9},xa=new Map([["ArrowLeft",[1,0]],["ArrowRight",[-1,0]],["ArrowUp",[0,1]],["ArrowDown",[0,-1]]]),ka=new Map([["+",N.zoom],["=",N.zoom],["-",1/N.zoom],["_",1/N.zoom]]);function Ro(n,e){if(e.ctrlKey||e.metaKey||e.altKey)return!1;let[t,r]=[xa.get(e.key),ka.get(e.key)];return t!==void 0&&e.shiftKey?n.pan(N.move*t[0],N.move*t[1]):t!==void 0?(n.rotateLeft(N.turn*t[0]),n.rotateUp(N.turn*t[1])):r!==void 0&&n.dollyIn(r),t!==void 0||r!==void 0}import{Vector3 as I}from"./vendor.js";var Pa=64;function Fo(n,e){let{draft:t}=n,{cloth:r,border:o,disk:s}=e;if(t!==void 0&&M(t))return Aa(t,e);if(o!==void 0)return{handles:[o]};let i=t?.hole??r?.hole??s?.point.hole,a=n.step.patches.find(l=>l.hole.id===i),d=n.patches.find(l=>l.hole.id===i);if(a===void 0||d===void 0)return{};let c=n.reportOf(d.hole.id??0)?.grid?.spacingMean??0;return t===void 0?r?{handles:[Pe(d,r)]}:s?Bo(s,d,c):{}:Sa(t,a,d,c)}function Bo({point:n,radius:e},t,r){let o=Pe(t,n),s=jn(o,new I(...K(t,n)),e*Pa*r);return{handles:[o],ring:s,disk:{center:o,ring:s}}}function Aa(n,{lines:e}){switch(n.kind){case"cut":{let t=new I(...n.center);return{handles:[t],ball:{center:t,radius:n.radius}}}case"polygon":{let t=n.corners.map(r=>new I(...r));return{handles:t,stretches:[t.length<3?t:[...t,...t.slice(0,1)]]}}case"border":{let t=H(n).map(s=>new I(...s)),{stretches:r,hems:o}=e(n);return{handles:t,stretches:r.map(Oo),dashes:o.map(Oo)}}}}function Oo(n){return n.map(e=>new I(...e))}function Sa(n,e,t,r){switch(n.kind){case"grab":{let o=$(e,n.uv),s=o&&Pe(e,o).add(new I(...n.offset));return o&&s?{handles:[s],tethers:[[Pe(t,o),s]]}:{}}case"twist":{let o=$(t,n.uv);return o?Bo({point:o,radius:n.radius},t,r):{}}case"pinch":{let s=n.uvs.map(d=>$(t,d)).filter(d=>d!==void 0).map(d=>Pe(t,d)),[i,a]=s;return{handles:s,tethers:i&&a?[[i,a]]:[]}}case"anchor":return{handles:[new I(...n.position)]}}}function Pe(n,e){return new I(...q(n,e))}import{Vector3 as V}from"./vendor.js";var $a=4,Ma=16,Ca=Math.PI/200,gt={step:1.1,least:.02,most:.5},No=new Map([["x",new V(1,0,0)],["y",new V(0,1,0)],["z",new V(0,0,1)]]),Io={cloth:void 0,onPatch:!1},bt=class extends PointerEvent{constructor(e){super("pointerdown",e)}},vt=class{constructor(e,t){this.viewer=e;this.editor=t;let{signal:r}=this.listening,o={capture:!0,signal:r},{canvas:s}=e;s.addEventListener("pointerdown",i=>this.down(i),o),s.addEventListener("pointermove",i=>this.move(i),o),s.addEventListener("pointerup",i=>this.up(i),o),s.addEventListener("pointercancel",()=>this.cancel(),o),s.addEventListener("pointerleave",()=>this.hover(void 0),{signal:r}),s.addEventListener("wheel",i=>this.wheel(i),{...o,passive:!1}),addEventListener("keydown",i=>this.key(i,!0),{signal:r}),addEventListener("keyup",i=>this.key(i,!1),{signal:r})}viewer;editor;hold;firstOfPinch;heldAxis;firstOfBorder;hovered;onMarks=()=>{};listening=new AbortController;get waitingPoint(){return this.editor.tool==="pinch"?this.firstOfPinch:void 0}get waitingEnd(){return this.editor.tool==="border"?this.firstOfBorder:void 0}get disk(){let{tool:e,work:t}=this.editor,r=this.hold===void 0?this.hovered:this.hold.cloth?.point;return e==="twist"&&t===void 0&&r?{point:r,radius:this.editor.twistRadius}:void 0}cancel(){this.hold=void 0,this.firstOfPinch=void 0,this.firstOfBorder=void 0,this.editor.dropDraft()}dispose(){this.listening.abort()}down(e){let{tool:t,work:r}=this.editor;if(e instanceof bt)return;if(this.hold!==void 0){this.joined(this.hold,e);return}if(t==="look"||r!==void 0||e.button!==0||!e.isPrimary)return;if(t==="border"){this.borderDown(e);return}let{draft:o}=this.editor;if(o?.kind==="polygon"&&this.takeHandle(e,o.corners))return;let s=this.viewer.pick(e.clientX,e.clientY),i=this.held(s?.cloth);if(t==="cut"||t==="polygon"){this.cutDown(e,s);return}s===void 0||i===void 0&&(t!=="anchor"||this.editor.editable.length===0)||(this.take(e,{hit:s,cloth:i}),this.onMarks())}hover(e){e!==this.hovered&&(this.hovered=e,this.onMarks())}take(e,{hit:t,cloth:r,part:o}){e.stopImmediatePropagation(),this.viewer.canvas.focus(),this.viewer.canvas.setPointerCapture(e.pointerId);let{pointerId:s,clientX:i,clientY:a}=e;this.hold={pointer:s,x:i,y:a,hit:t,cloth:r,part:o,moved:!1,before:this.editor.draft,last:e}}joined(e,t){if(t.pointerType!=="touch"||e.last.pointerType!=="touch"){t.stopImmediatePropagation();return}this.hold=void 0,e.before===void 0?this.editor.dropDraft():this.editor.preview(e.before),this.viewer.canvas.dispatchEvent(new bt(e.last))}takeHandle(e,t){let r=t.map(s=>new V(...s)),o=this.viewer.aim.nearestOf(r,{x:e.clientX,y:e.clientY},Ma);return o===void 0?!1:(this.take(e,{hit:{position:o,...Io},cloth:void 0,part:r.indexOf(o)}),!0)}cutDown(e,t){if(t===void 0)return;if(t.onPatch){e.stopImmediatePropagation(),this.editor.say("Only cloth of the scan itself can be cut out.");return}if(this.editor.tool==="polygon"){this.cornerDown(e,t);return}this.take(e,{hit:t,cloth:void 0});let{radius:r}=this.cutDraft();this.editor.preview({kind:"cut",center:t.position.toArray(),radius:r})}cornerDown(e,t){this.take(e,{hit:t,cloth:void 0,part:this.polygonDraft().corners.length});let r=this.polygonDraft();this.editor.preview({...r,corners:[...r.corners,t.position.toArray()]})}polygonDraft(){let{draft:e}=this.editor;return e?.kind==="polygon"?e:{kind:"polygon",corners:[]}}cutDraft(){let{draft:e,scan:t}=this.editor,r={loops:t?.loops??[],candidates:[]};return e?.kind==="cut"?e:$e("cut",r)}borderDown(e){let{draft:t}=this.editor;if(t?.kind==="border"){this.takeHandle(e,H(t));return}let r=this.viewer.nearestOfBorder(e.clientX,e.clientY);r!==void 0&&this.take(e,{hit:{position:r,...Io},cloth:void 0})}bordered({hit:e,moved:t}){let{draft:r}=this.editor;if(t||r?.kind==="border")return;let o=this.firstOfBorder;if(o===void 0){this.firstOfBorder=e.position,this.editor.say("Border: click where the stretch ends.");return}this.firstOfBorder=void 0,this.editor.say("Border: drag its ends, or mend it."),this.editor.preview({kind:"border",from:o.toArray(),to:e.position.toArray(),along:[]})}movedHandle({hit:e,part:t=0},{clientX:r,clientY:o}){let{draft:s}=this.editor;if(s?.kind!=="border")return;let a=t<jr(s)?this.viewer.nearestOfBorder(r,o):this.viewer.aim.onScreenPlane(r,o,e.position);return a&&Ee(s,t,a.toArray())}movedCorner({part:e=0},{clientX:t,clientY:r}){let{draft:o}=this.editor,s=this.viewer.pick(t,r),i=s!==void 0&&!s.onPatch;return o?.kind==="polygon"&&i?Me(o,e,s.position.toArray()):void 0}move(e){let{hold:t}=this;if(t===void 0&&e.buttons===0){let o=this.editor.tool==="twist";this.hover(o?this.viewer.pick(e.clientX,e.clientY)?.cloth:void 0)}if(t===void 0||e.pointerId!==t.pointer)return;e.stopImmediatePropagation(),t.last=e,t.moved||=Math.hypot(e.clientX-t.x,e.clientY-t.y)>$a;let r=t.moved?this.dragged(t,e):void 0;r!==void 0&&this.editor.preview(r)}up(e){let{hold:t}=this;if(t===void 0||e.pointerId!==t.pointer)return;e.stopImmediatePropagation(),this.hold=void 0,this.hover(e.pointerType==="touch"?void 0:t.cloth?.point);let{tool:r}=this.editor;r==="pinch"?this.pinched(t):r==="border"?this.bordered(t):r==="cut"?this.editor.say("Cut out: change the ball, or cut it out and mend."):r==="polygon"?this.editor.say(Ea(this.editor.draft)):r==="anchor"&&!t.moved?(this.editor.preview(this.anchorAt(t,t.hit.position)),this.editor.commit()):t.moved&&this.editor.draft!==void 0&&this.editor.commit()}dragged(e,t){let{cloth:r}=e;switch(this.editor.tool){case"grab":return r&&this.grabbed(r,t);case"twist":return r&&this.twisted(r,t.clientX-e.x);case"anchor":{let o=this.viewer.aim.onScreenPlane(t.clientX,t.clientY,e.hit.position);return o&&this.anchorAt(e,o)}case"cut":{let s=this.viewer.aim.onScreenPlane(t.clientX,t.clientY,e.hit.position)?.distanceTo(e.hit.position)??0;return s>0?{kind:"cut",center:e.hit.position.toArray(),radius:s}:void 0}case"polygon":return this.movedCorner(e,t);case"border":return this.movedHandle(e,t);default:return}}grabbed({point:e,position:t,normal:r},o){let{clientX:s,clientY:i}=o,a=o.shiftKey?r:No.get(this.heldAxis??""),d=a?this.viewer.aim.onLine(s,i,t,a):this.viewer.aim.onScreenPlane(s,i,t),{hole:c,uv:l}=e;return d&&{kind:"grab",hole:c,uv:l,offset:d.sub(t).toArray()}}twisted({point:e,normal:t},r){let o=t.clone();o.dot(this.viewer.camera.getWorldDirection(new V))>0&&o.negate();let{hole:s,uv:i}=e;return{kind:"twist",hole:s,uv:i,radius:this.editor.twistRadius,axis:o.toArray(),angle:-r*Ca}}anchorAt({cloth:e},t){let r=t.toArray(),o=Or(this.editor.editable,r)?.hole.id??0,{draft:s}=this.editor,i=s?.kind==="anchor"&&s.hard;return{kind:"anchor",hole:e?.point.hole??o,position:r,hard:i}}pinched({cloth:e}){let t=this.firstOfPinch;if(e===void 0)return;if(t===void 0||t.hole!==e.point.hole){this.firstOfPinch=e.point,this.editor.say("Pinch: click the second point.");return}this.firstOfPinch=void 0;let r=[t.uv,e.point.uv];this.editor.say("Pinch: choose how much, then apply."),this.editor.preview({kind:"pinch",hole:t.hole,uvs:r,amount:.5})}wheel(e){let{draft:t}=this.editor;if(t?.kind==="cut"){let s=this.viewer.pick(e.clientX,e.clientY);s!==void 0&&s.position.distanceTo(new V(...t.center))<=t.radius&&(e.preventDefault(),e.stopImmediatePropagation(),this.editor.preview({...t,radius:t.radius*gt.step**-Math.sign(e.deltaY)}));return}let r=this.editor.tool==="twist"?this.viewer.pick(e.clientX,e.clientY)?.cloth:void 0;if(r===void 0)return;this.hovered=r,e.preventDefault(),e.stopImmediatePropagation();let o=this.editor.twistRadius*gt.step**-Math.sign(e.deltaY);this.editor.setTwistRadius(Math.min(Math.max(o,gt.least),gt.most))}key(e,t){let r=e.key.toLowerCase();t&&r==="escape"?this.cancel():No.has(r)&&(t?this.hold!==void 0:r===this.heldAxis)&&(this.heldAxis=t?r:void 0)}held(e){let t=this.editor.step.patches.find(({hole:r})=>r.id===e?.hole);return e&&t&&{point:e,position:new V(...q(t,e)),normal:new V(...K(t,e))}}};function Ea(n){let e=n?.kind==="polygon"?n.corners.length:0,t=e<3?"click the next one":"click another, or cut it out and mend";return`Cut out: ${e} ${e===1?"corner":"corners"}; ${t}.`}import{css as Ra,html as Oa}from"./vendor.js";import{css as Ta,html as z,nothing as $r,unsafeCSS as wt}from"./vendor.js";var Ho=Ta`
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
    background: ${wt(ar("curvature"))};
  }
  .bar.confidence {
    background: ${wt(ar("confidence"))};
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
    background: ${wt(Zn)};
  }
  .patch.own {
    background: ${wt(eo)};
  }
`,Vo="From blue over white to orange",Da={stretch:{title:"Stretch",about:"Lengths of the cloth, compared with the same cloth laid flat.",unknown:"Grey: not laid flat: away from the mended holes.",bar:Vo,ends:n=>{let e=`${g(n*100)} %`;return[`${Number(((1-1/(1+n))*100).toPrecision(2))} % shorter`,"as flat",`${e} longer`]}},curvature:{title:"Curvature",about:"Whether the cloth bends in two directions at once. Cloth that is only folded stays white.",unknown:"Grey: not known.",bar:Vo,unit:"In one over the scan's unit squared.",ends:n=>[`saddle, \u2212${g(n)}`,"flat or folded, 0",`dome, ${g(n)}`]},confidence:{title:"Confidence",about:"How far new cloth may be off: nine of ten vertices lie within 1.6 times this of the cloth that was there. That is of the cloth before anchors and gestures.",unknown:"Dark grey: new cloth of which it is not known.",bar:"From light yellow over orange to dark brown",own:"Light grey: the scan's own cloth.",unit:"In the scan's unit.",ends:n=>["certain, 0",`uncertain, ${g(n)}`]}},La="Nothing is known: no hole is mended yet, or none that is has a chart and was filled with weights that were calibrated.";function Uo(n,e){if(n===void 0)return $r;let{title:t,about:r,unknown:o,bar:s,own:i,unit:a,ends:d}=Da[n];if(e===void 0)return z`<div class="legend" role="status"><strong>${t}</strong> is computed …</div>`;let c=Number.isNaN(e.most);return z`
    <div class="legend" role="group" aria-label="Legend: ${t}">
      <strong>${t}</strong>
      ${c?z`<p>${La}</p>`:z`<div class="bar ${n}" role="img" aria-label=${s}></div>
              <div class="ends">${d(e.most).map(l=>z`<span>${l}</span>`)}</div>
              <p>${r}</p>`}
      <p><span class="patch"></span> ${o}</p>
      ${i===void 0?$r:z`<p><span class="patch own"></span> ${i}</p>`}
      ${a===void 0||c?$r:z`<p class="quiet">${a}</p>`}
    </div>
  `}var Fa=60,Mr=class extends y{static styles=[y.styles,Ho,Ra`
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
    `].flat();viewer;gestures;heat;scale;opened=()=>{this.show()};connectedCallback(){super.connectedCallback(),this.editor.addEventListener("opened",this.opened)}disconnectedCallback(){super.disconnectedCallback(),this.editor.removeEventListener("opened",this.opened),this.gestures?.dispose(),this.viewer?.dispose(),this.viewer=void 0}render(){return Oa`<div id="host"></div>
      ${Uo(this.heat,this.scale)}`}firstUpdated(){let e=this.renderRoot.querySelector("#host");if(e===null)return;try{this.viewer=new ht(e),this.gestures=new vt(this.viewer,this.editor),this.gestures.onMarks=()=>this.requestUpdate()}catch(r){this.editor.report(new Error(`This browser draws no 3-D pictures (WebGL 2): ${String(r)}`));return}this.viewer.onError=r=>this.editor.report(r),this.viewer.onHeat=(r,o)=>{this.heat=r,this.scale=o,this.requestUpdate()};let{canvas:t}=this.viewer;t.setAttribute("role","img"),t.setAttribute("aria-label","The scan. Drag or arrow keys to turn it; two fingers, the right button or Shift and arrow keys to move it; the wheel, plus or minus to zoom; F to see all."),t.addEventListener("keydown",r=>{this.viewer!==void 0&&Ro(this.viewer.controls,r)&&r.preventDefault()}),t.addEventListener("dblclick",r=>{let o=this.viewer?.pick(r.clientX,r.clientY);o!==void 0&&this.viewer?.pivotAt(o.position)})}updated(){this.viewer?.chooseLoops(this.editor.chosen),this.viewer?.showPatches(this.editor.patches),this.viewer?.showCut(this.editor.step.cutFaces),this.viewer?.mark(Fo(this.editor,{cloth:this.gestures?.waitingPoint,border:this.gestures?.waitingEnd,disk:this.gestures?.disk,lines:e=>this.viewer?.borderLines(e)??{stretches:[],hems:[]}}),this.editor.isAsking?Fa:0)}async show(){let{scan:e}=this.editor;if(e!==void 0)try{await this.viewer?.showScan(e.bytes,e.loops),this.requestUpdate()}catch(t){this.editor.report(new Error(`The scan was read by the service, but cannot be drawn: ${String(t)}`))}}};customElements.define("darn-stage",Mr);import{css as Ba,html as b,nothing as D}from"./vendor.js";var xt=[{tool:"look",name:"Look",key:"L",help:"Drag to turn the scan, right button or two fingers to move it, wheel to zoom. With the picture in focus, the arrow keys turn it, with Shift they move it, + and - zoom."},{tool:"grab",name:S.grab,key:"G",help:"Drag new cloth in the plane of the screen; hold Shift to pull it along its normal, or X, Y or Z along an axis."},{tool:"twist",name:S.twist,key:"T",help:"Drag to the left or right on new cloth to turn a disk of it; the wheel changes its size."},{tool:"pinch",name:S.pinch,key:"P",help:"Click two points of new cloth, then choose how far to draw them together."},{tool:"anchor",name:S.anchor,key:"A",help:"Drag from the cloth to where it should be, or type the point; the service finds which place of the cloth belongs there. That place is a dot on the chart, which can be dragged."},{tool:"cut",name:S.cut,key:"C",help:"For stained, torn or badly scanned cloth: press on its middle and drag to its edge. What the ball touches is cut out, and new cloth is put in. The wheel changes its size."},{tool:"border",name:S.border,key:"E",help:"For a bite or a rip at the edge of the cloth: click where it begins and where it ends. New cloth goes up to the dashed line; add points where the new hem should go. Where the cloth is torn in two, add the edge that faces it: the two are joined."}],Na="For damaged cloth of any outline: click its corners one after another. A corner can be dragged, and Backspace takes the last one back. What lies under the polygon is cut out, and new cloth is put in.",Ia=[["cut","Ball"],["polygon","Polygon"]];function Er(n){return!["look","cut","polygon","border"].includes(n)}var Va={grab:"Apply",twist:"Apply",pinch:"Apply",anchor:"Find its place",cut:"Cut out and mend",polygon:"Cut out and mend",border:"Mend up to the new hem"};function Ha(n){return n.kind==="anchor"&&n.uv!==void 0?"Apply":Va[n.kind]}var jo=b`<span class="wide quiet small">u and v: the place on the chart, from 0 to 1</span>`,Ua=["x","y","z"],Cr=class extends y{static styles=[y.styles,Ba`
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
    `].flat();render(){let{tool:e,step:t,editable:r}=this.editor,o=e==="polygon"?"cut":e,s=e==="polygon"?Na:xt.find(i=>i.tool===e)?.help??"";return b`
      <h2>Tools</h2>
      <div class="row tools" role="group" aria-label="Tools">
        ${xt.map(i=>b`
            <button
              aria-pressed=${i.tool===o}
              aria-keyshortcuts=${i.key}
              title="${i.name} (${i.key})"
              ?disabled=${r.length===0&&Er(i.tool)}
              @click=${()=>this.editor.setTool(i.tool)}
            >
              ${i.name}
            </button>
          `)}
      </div>
      <p class="quiet small">${s}</p>
      ${r.length>0||e!=="look"?D:b`<p class="quiet small">${ja(t.patches.length)}</p>`}
      ${e==="look"?D:this.form(this.draftOf(e))}
    `}draftOf(e){let{draft:t,editable:r,scan:o,step:s}=this.editor,[i]=r;if(t?.kind===e)return t;if(e==="cut"||e==="polygon"||e==="border")return o&&$e(e,{...o,candidates:Vr(o.candidates,s.made)});let a=i&&St(e,i);return a?.kind==="twist"?{...a,radius:this.editor.twistRadius}:a}form(e){if(e===void 0)return D;let{work:t}=this.editor,r=t!==void 0;return b`
      <form @submit=${o=>this.apply(o,e)}>
        ${M(e)?this.shapes(e):this.holeField(e)} ${this.fields(e)}
        <div class="row wide">
          <button class="main" ?disabled=${r||!Ir(e)||this.isUnseen(e)}>
            ${Ha(e)}
          </button>
          <button type="button" ?disabled=${this.editor.draft===void 0} @click=${()=>this.editor.dropDraft()}>
            Cancel
          </button>
          ${e.kind==="anchor"?this.mapButton(e):D}
        </div>
      </form>
    `}isUnseen(e){return e.kind==="border"&&e!==this.editor.draft}mapButton(e){let{work:t,map:r}=this.editor;return r?.isComing?b`
        <button type="button" @click=${()=>this.editor.stopMap()}>Stop the map</button>
        <progress aria-label="The map" max="1" .value=${r.share}></progress>
      `:b`<button type="button" ?disabled=${t!==void 0} @click=${()=>{this.editor.drawMap(e)}}>Draw the map</button>`}holeField(e){let t=this.editor.editable;return t.length<2?D:b`
      <label class="wide">
        Hole
        <select @change=${o=>{let s=Number(o.target.value),i=t.find(({hole:a})=>a.id===s);i!==void 0&&this.preview(e.kind==="anchor"?{...e,hole:s}:St(e.kind,i))}}>
          ${t.map(({hole:o})=>b`<option value=${o.id} ?selected=${o.id===e.hole}>${o.id}</option>`)}
        </select>
      </label>
    `}fields(e){switch(e.kind){case"grab":return this.grabFields(e);case"twist":return this.twistFields(e);case"pinch":return this.pinchFields(e);case"anchor":return this.anchorFields(e);case"cut":return this.cutFields(e);case"polygon":return this.polygonFields(e);case"border":return this.borderFields(e)}}grabFields(e){return b`
      ${jo} ${this.uvFields(e.uv,"",t=>({...e,uv:t}))}
      <span></span>
      ${this.vectorFields("Move",e.offset,t=>({...e,offset:t}))}
    `}twistFields(e){let t=e.angle*180/Math.PI;return b`
      ${jo} ${this.uvFields(e.uv,"",r=>({...e,uv:r}))}
      ${this.number("Radius",e.radius,r=>({...e,radius:r}))}
      ${this.vectorFields("Axis",e.axis,r=>({...e,axis:r}))}
      ${this.number("Angle in degrees",t,r=>({...e,angle:r*Math.PI/180}))}
    `}pinchFields(e){let[t,r]=e.uvs,o=s=>{this.preview({...e,amount:Number(s.target.value)})};return b`
      ${this.uvFields(t,"First ",s=>({...e,uvs:[s,r]}))}
      <span></span>
      ${this.uvFields(r,"Second ",s=>({...e,uvs:[t,s]}))}
      <span></span>
      <label class="wide">
        Share of their distance to take away: ${Math.round(e.amount*100)} %
        <input type="range" min="0" max="1" step="0.01" .value=${String(e.amount)} @input=${o} />
      </label>
    `}anchorFields(e){let t=r=>{this.preview({...e,hard:r.target.checked})};return b`
      ${this.vectorFields("Point",e.position,r=>({...e,position:r}))} ${this.placeFields(e)}
      <label class="wide choice">
        <input type="checkbox" .checked=${e.hard} @change=${t} />
        Hard: refuse it where the cloth cannot reach it
      </label>
    `}placeFields(e){let t=this.editor.editable.find(({hole:o})=>o.id===e.hole),r=e.uv??(t===void 0?void 0:Ae(t))??[.5,.5];return["u","v"].map((o,s)=>this.number(o,e.uv?.[s],i=>({...e,uv:r.with(s,i)})))}cutFields(e){return b`
      ${this.vectorFields("Centre",e.center,t=>({...e,center:t}))}
      ${this.number("Radius",e.radius,t=>({...e,radius:t}))} ${this.cutEdges()}
    `}polygonFields(e){let{corners:t}=e,{scan:r}=this.editor,o=()=>this.preview(Ur(e,r?.loops??[])),s=()=>this.preview(Ce(e));return b`
      ${t.map((i,a)=>this.vectorFields(`Corner ${a+1}`,i,d=>Me(e,a,d)))}
      <div class="row wide">
        <button type="button" @click=${o}>Add a corner</button>
        <button type="button" ?disabled=${t.length===0} @click=${s}>Take the last corner back</button>
      </div>
      ${t.length<2?D:this.number("Depth",Mt(e),i=>({...e,depth:i}))}
      ${this.cutEdges()}
    `}shapes({kind:e}){return e==="border"?D:b`
      <fieldset class="wide">
        <legend class="quiet small">Shape</legend>
        ${Ia.map(([t,r])=>b`
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
    `}cutEdges(){let{scan:e,chosen:t,work:r}=this.editor,s=(e?.loops??[]).filter(A).map(a=>a.id??0).filter(a=>t.has(a));return s.length===0?D:b`
      <div class="row wide">
        <button type="button" ?disabled=${r!==void 0} @click=${()=>{this.editor.make("Cut edges back",{cut:{loops:s}})}}>Cut the edges of chosen holes back</button>
      </div>
    `}borderFields(e){let{from:t,to:r,along:o,facing:s}=e,i=[0,1,2].map(u=>(t[u]+r[u])/2),a=()=>this.preview({...e,along:[...o,o.at(-1)??i]}),d=u=>this.preview({...e,along:o.filter((p,f)=>f!==u)}),l=["From","To",...s?["Facing from","Facing to"]:o.map((u,p)=>`Hem ${p+1}`)],h=H(e).map((u,p)=>this.vectorFields(l[p],u,f=>Ee(e,p,f)));return s!==void 0?b`
        ${h}
        <div class="row wide">
          <button type="button" @click=${()=>this.preview(Wr(e))}>Without the facing edge</button>
        </div>
      `:b`
      ${h}
      <div class="row wide">
        <button type="button" @click=${()=>this.preview(_r(e))}>Join with a facing edge</button>
        <button type="button" @click=${a}>Add a point of the hem</button>
        ${o.length>0?b`<button type="button" @click=${()=>d(o.length-1)}>Remove the last point</button>`:D}
      </div>
    `}uvFields([e,t],r,o){return[this.number(`${r}u`,e,s=>o([s,t])),this.number(`${r}v`,t,s=>o([e,s]))]}vectorFields(e,t,r){return Ua.map((o,s)=>this.number(`${e} ${o}`,t[s],i=>r(t.with(s,i))))}number(e,t,r){let o=s=>{let i=s.target.valueAsNumber;Number.isFinite(i)&&this.preview(r(i))};return b`
      <label>
        ${e}
        <input
          type="number"
          step="any"
          placeholder="found"
          .value=${t===void 0?"":String(Number(t.toPrecision(6)))}
          @change=${o}
        />
      </label>
    `}preview(e){this.editor.preview(e)}apply(e,t){e.preventDefault(),this.editor.preview(t),this.editor.commit()}};customElements.define("darn-tools",Cr);function ja(n){return n===0?"Mend a hole to edit its new cloth.":"The cloth around what is filled cannot be laid flat, so its new cloth takes no gestures."}import{html as _a}from"./vendor.js";function _o(n,e){return _a`
    <div class="welcome">
      <h2>Mend a scan of cloth</h2>
      <p>
        Drop a glTF file here: a GLB, or a glTF together with the files that it refers to. The service finds its holes
        and fills them with cloth that continues the folds around them. The scan itself stays as it is.
      </p>
      <div class="row">
        <button class="main" @click=${n}>Open a scan</button>
        <button id="example" @click=${e}>Try the example</button>
      </div>
    </div>
  `}var Dr=class extends Wa{static styles=[te,Ga`
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
    `];static properties={src:{},key:{},baseUrl:{attribute:"base-url"}};dragging=!1;shown=ur;savedLook="blended";made;constructor(){super(),this.addEventListener("dragover",this.dragOver),this.addEventListener("dragleave",this.dragLeave),this.addEventListener("drop",this.drop)}get editor(){return this.made??=this.makeEditor(),this.made}makeEditor(){let e=new mt(this.base),t=async()=>{await this.updateComplete;let s=await this.keyDialog?.ask();return e.keep(s),s},r=new ue(this.base,{key:this.key??e.kept,askForKey:t}),o=new Ge(r);o.addEventListener("change",()=>this.requestUpdate()),o.addEventListener("opened",()=>{this.change({split:0}),this.emit("opened",{name:o.scan?.name})});for(let s of["mended","edited"])o.addEventListener(s,()=>{let{report:i,constraints:a}=o.step;this.emit(s,{report:i,constraints:a})});return o}get base(){return new URL(this.baseUrl??new URL("..",import.meta.url),document.baseURI)}connectedCallback(){super.connectedCallback(),addEventListener("keydown",this.keyDown),addEventListener("keyup",this.keyUp)}disconnectedCallback(){super.disconnectedCallback(),removeEventListener("keydown",this.keyDown),removeEventListener("keyup",this.keyUp)}willUpdate(e){let{src:t}=this;if(!(!e.has("src")||t===void 0))try{this.editor.openAddress(new URL(t,document.baseURI))}catch{this.editor.report(new Error(`${t} is not an address.`))}}emit(e,t){return this.dispatchEvent(new CustomEvent(e,{detail:t,bubbles:!0,composed:!0,cancelable:!0}))}render(){let{editor:e}=this,{scan:t,work:r}=e;return ne`
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
        ${t===void 0&&r===void 0?_o(this.pick,this.openExample):Tr} ${this.notices()}
        ${this.said()}
      </main>
      <aside
        @darn-frame=${this.frame}
        @darn-look=${this.look}
        @darn-saved-look=${this.chooseSavedLook}
        @darn-picture=${this.savePicture}
      >
        ${t===void 0?ne`<p class="quiet">The holes of the scan will be listed here.</p>`:ne`
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
    `}said(){let{work:e,problem:t,message:r}=this.editor;return ne`
      <div class=${e===void 0&&t===void 0&&r!==""?"said":"hidden"} role="status" aria-live="polite">${e?.label??r}</div>
    `}notices(){let{work:e,problem:t}=this.editor;return t!==void 0?ne`
        <div class="notice problem" role="alert">
          <p>${t}</p>
          <button @click=${()=>this.editor.clearProblem()}>Close</button>
        </div>
      `:e===void 0?Tr:ne`
      <div class="notice">
        <div class="row">
          ${e.label} …
          <button @click=${()=>e.stop.abort()}>Stop</button>
        </div>
        <progress aria-label=${e.label} value=${e.share??Tr}></progress>
      </div>
    `}get keyDialog(){return this.renderRoot.querySelector("darn-key")}get stage(){return this.renderRoot.querySelector("darn-stage")}pick=()=>this.renderRoot.querySelector("#file")?.click();picked=e=>{let t=e.target;this.openFiles([...t.files??[]]),t.value=""};async openFiles(e){try{let t=await pn(e);t!==void 0&&await this.editor.open(t.file,t.name)}catch(t){this.editor.report(t)}}openExample=()=>{this.editor.openAddress(new URL("editor/scarf_hole.glb",this.base))};save=async()=>{let e=await this.editor.result();if(e!==void 0){let t=await bn(e,this.savedLook),o=(this.editor.scan?.name??"scan.glb").replace(/(\.[a-z]+)?$/i,s=>`.mended${s||".glb"}`);this.emit("saved",{file:t,name:o})&&W(t,o)}};chooseSavedLook=({detail:e})=>{this.savedLook=e,this.requestUpdate()};savePicture=async()=>{let e=await this.stage?.viewer?.picture();e!==void 0&&(W(e,`${ee(this.editor.scan?.name)}.png`),this.editor.say("The picture is saved."))};dragOver=e=>{e.preventDefault(),this.setDragging(!0)};dragLeave=()=>this.setDragging(!1);drop=e=>{e.preventDefault(),this.setDragging(!1),this.openFiles([...e.dataTransfer?.files??[]])};setDragging(e){this.dragging=e,this.requestUpdate()}frame=e=>this.stage?.viewer?.frame(e.detail);look=e=>this.change(e.detail);change(e){this.shown={...this.shown,...e},this.stage?.viewer?.setLook(e),this.requestUpdate()}keyDown=e=>{if(!this.isMeant(e))return;let t=e.key.toLowerCase();if((e.ctrlKey||e.metaKey)&&(t==="z"||t==="y")&&!Wo(e)){e.preventDefault(),t==="y"||e.shiftKey?this.editor.redo():this.editor.undo();return}if(e.ctrlKey||e.metaKey||e.altKey||Wo(e))return;let r=xt.find(s=>s.key.toLowerCase()===t)?.tool,o=this.editor.scan!==void 0&&(this.editor.editable.length>0||!Er(r??"look"));r!==void 0&&o?this.editor.setTool(r):t==="backspace"&&this.editor.draft?.kind==="polygon"?this.editor.preview(Ce(this.editor.draft)):t==="f"?this.stage?.viewer?.frame():t==="b"&&this.stage?.viewer?.setLook({before:!0})};isMeant(e){let t=e.composedPath();return t.includes(this)||t[0]===document.body}keyUp=e=>{e.key.toLowerCase()==="b"&&this.stage?.viewer?.setLook({before:!1})}};function Wo(n){let e=n.composedPath()[0];return e instanceof HTMLTextAreaElement||e instanceof HTMLInputElement&&!["checkbox","radio","range","button"].includes(e.type)}customElements.define("darn-editor",Dr);
