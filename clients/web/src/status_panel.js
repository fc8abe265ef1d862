// Health, rates, latencies and findings of the server, as its status says.

const healths = ["initialised", "good", "degenerate", "lost"];
const element = (id) => document.getElementById(id);

function row(name, value, kind = "") {
  const line = document.createElement("tr");
  for (const text of [name, value]) line.appendChild(document.createElement("td")).textContent = text;
  line.className = kind;
  return line;
}

export function showStatus(status) {
  const table = document.createElement("table");
  const health = healths[status.health] ?? `health ${status.health}`;
  table.append(row("health", health, health === "good" ? "good" : "bad"));
  if (status.reason) table.append(row("reason", status.reason, "bad"));
  table.append(row("scans received", `${status.received_hz.toFixed(1)} Hz`), row("scans mapped", `${status.mapped_hz.toFixed(1)} Hz`),
    row("voxels", status.voxel_count.toString()), row("tiles", status.tile_count.toString()),
    row("map version", status.map_version.toString()), row("labels", status.label_source));
  for (const { name, detail, value } of status.counters) {
    if (value > 0n && /drop|lost/.test(name)) table.append(row(`${name}${detail ? ` (${detail})` : ""}`, value.toString()));
  }
  for (const { stage, p50_ms, p99_ms } of status.latencies) {
    table.append(row(`${stage} [ms]`, `${p50_ms.toFixed(1)}, p99 ${p99_ms.toFixed(1)}`, "dim"));
  }
  element("status").replaceChildren(table);
  showFindings(status.diagnostics);
}

function showFindings(diagnostics) {
  const items = diagnostics.map(({ severity, what, evidence, hint }) => {
    const item = document.createElement("li");
    item.className = severity > 1 ? "bad" : "";
    item.textContent = `${what}: ${evidence}. ${hint}`;
    return item;
  });
  if (items.length === 0) items.push(Object.assign(document.createElement("li"), { textContent: "none" }));
  element("findings").replaceChildren(...items);
}
