// What the server is asked, and arrays as they come: a line of JSON, then numbers (motorctl/scope/wire.py).

export class Refused extends Error {}

async function got(path, query, signal) {
  const response = await fetch(`api/${path}?${new URLSearchParams(query)}`, { signal });
  if (!response.ok) throw new Refused((await response.text()).trim());
  return response;
}

export async function askJson(path, query = {}, signal = undefined) {
  return (await got(path, query, signal)).json();
}

/** Return what is told, and its arrays by name. */
export async function askArrays(path, query, signal = undefined) {
  const body = await (await got(path, query, signal)).arrayBuffer();
  const bytes = new Uint8Array(body);
  const end = bytes.indexOf(10) + 1;
  const told = JSON.parse(new TextDecoder().decode(bytes.subarray(0, end)));
  const arrays = {};
  let place = end;
  for (const [name, length] of told.arrays) {
    arrays[name] = new Float64Array(body, place, length);
    place += 8 * length;
  }
  return { ...told, arrays };
}

/** Ask for a change of the scope itself. */
export async function send(path, body) {
  const response = await fetch(`api/${path}`, { method: "POST", body });
  if (!response.ok) throw new Refused((await response.text()).trim());
}
