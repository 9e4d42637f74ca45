// Scans that the tests make themselves.

/**
 * A wavy sheet as GLB, 0.05 scene units a square, without the squares that `missing` says.
 *
 * @param {number} side squares of a side
 * @param {(i: number, j: number) => boolean} missing
 */
export function sheetGlb(side, missing) {
  const at = (i, j) => j * (side + 1) + i;
  const positions = new Float32Array(3 * (side + 1) ** 2);
  for (let j = 0; j <= side; j += 1) {
    for (let i = 0; i <= side; i += 1) {
      positions.set([0.05 * i, 0.05 * Math.sin(0.4 * i), 0.05 * j], 3 * at(i, j));
    }
  }
  const corners = [];
  for (let j = 0; j < side; j += 1) {
    for (let i = 0; i < side; i += 1) {
      if (!missing(i, j)) {
        const [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        corners.push(a, c, b, a, d, c);
      }
    }
  }
  const indices = Uint32Array.from(corners);
  const max = [0, 1, 2].map((axis) =>
    positions.reduce((most, value, index) => (index % 3 === axis ? Math.max(most, value) : most), -1),
  );
  const min = [0, 1, 2].map((axis) =>
    positions.reduce((least, value, index) => (index % 3 === axis ? Math.min(least, value) : least), 9),
  );
  const json = {
    asset: { version: '2.0' },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1 }] }],
    accessors: [
      { bufferView: 0, componentType: 5126, count: positions.length / 3, type: 'VEC3', min, max },
      { bufferView: 1, componentType: 5125, count: indices.length, type: 'SCALAR' },
    ],
    bufferViews: [
      { buffer: 0, byteOffset: 0, byteLength: positions.byteLength },
      { buffer: 0, byteOffset: positions.byteLength, byteLength: indices.byteLength },
    ],
    buffers: [{ byteLength: positions.byteLength + indices.byteLength }],
  };
  let text = JSON.stringify(json);
  text += ' '.repeat((4 - (text.length % 4)) % 4);
  const header = Buffer.alloc(20);
  const binary = Buffer.concat([Buffer.from(positions.buffer), Buffer.from(indices.buffer)]);
  header.write('glTF');
  header.writeUInt32LE(2, 4);
  header.writeUInt32LE(28 + text.length + binary.length, 8);
  header.writeUInt32LE(text.length, 12);
  header.write('JSON', 16);
  const chunk = Buffer.alloc(8);
  chunk.writeUInt32LE(binary.length, 0);
  chunk.write('BIN\0', 4);
  return Buffer.concat([header, Buffer.from(text), chunk, binary]);
}

/** A sheet of 60 squares with three holes far from each other, their rims ragged as damage is. */
export function sheetWithThreeHoles() {
  const holes = [
    [10, 10],
    [40, 12],
    [25, 42],
  ];
  // Six squares a side, and every other square along the sides.
  const inHole = (i, j) => {
    const inside = (value) => value >= 0 && value < 6;
    const tooth = (along, across) => inside(along) && along % 2 === 1 && (across === -1 || across === 6);
    return (inside(i) && inside(j)) || tooth(i, j) || tooth(j, i);
  };
  return sheetGlb(60, (i, j) => holes.some(([x, y]) => inHole(i - x, j - y)));
}

/** A sheet of 40 squares with a bite in the middle of one side, eight wide and six deep. */
export function sheetWithBite() {
  return sheetGlb(40, (i, j) => (i - 19.5) ** 2 / 16 + j ** 2 / 36 < 1);
}

/** A sheet of 40 squares with a round neck of six squares, and a bite that leads from the neck to near the side: its edge is longer than the rest of the neck's. */
export function sheetWithBittenNeck() {
  return sheetGlb(40, (i, j) => Math.hypot(i - 19.5, j - 10) < 3 || (Math.abs(i - 19.5) < 2 && j > 10 && j < 34));
}

/** A sheet with a hole, and a piece of which only the outermost squares are left: cloth that fills it would be a guess. */
export function sheetAndFrame() {
  return sheetGlb(60, (i, j) => {
    if (j >= 30 || (i >= 28 && i < 32)) {
      return true;
    }
    return i < 28 ? Math.hypot(i - 13.5, j - 14.5) < 4.3 : i > 32 && i < 59 && j > 0 && j < 29;
  });
}

/** A sheet of 40 squares torn in two: a gap of three squares, its edges ragged. */
export function sheetTornInTwo() {
  return sheetGlb(40, (i, j) => Math.abs(i - 19.5 - (j % 2)) < 1.6);
}

/** A sheet with one hole whose vertices have colours, as a glTF. */
export function sheetInColours() {
  const glb = sheetGlb(30, (i, j) => Math.hypot(i - 14.5, j - 14.5) < 4.3);
  const end = 20 + glb.readUInt32LE(12);
  const gltf = JSON.parse(glb.subarray(20, end));
  const [{ count }] = gltf.accessors;
  const colours = Float32Array.from({ length: 3 * count }, (_, at) => at / (3 * count));
  const binary = glb.subarray(end + 8);
  const bytes = Buffer.concat([binary, Buffer.from(colours.buffer)]);
  gltf.bufferViews.push({ buffer: 0, byteOffset: binary.length, byteLength: colours.byteLength });
  gltf.accessors.push({ bufferView: 2, componentType: 5126, count, type: 'VEC3' });
  gltf.meshes[0].primitives[0].attributes.COLOR_0 = 2;
  gltf.buffers = [
    { byteLength: bytes.length, uri: `data:application/octet-stream;base64,${bytes.toString('base64')}` },
  ];
  return Buffer.from(JSON.stringify(gltf));
}

/** A sheet with one hole as a glTF, `sheet.gltf`, whose data is in a file of its own, `sheet.bin`. */
export function sheetInFiles() {
  const glb = sheetGlb(30, (i, j) => Math.hypot(i - 14.5, j - 14.5) < 4.3);
  const end = 20 + glb.readUInt32LE(12);
  const gltf = JSON.parse(glb.subarray(20, end));
  gltf.buffers[0].uri = 'sheet.bin';
  return { gltf: Buffer.from(JSON.stringify(gltf)), bin: glb.subarray(end + 8) };
}
