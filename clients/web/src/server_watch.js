// Whether the server still speaks: a connection whose other side is gone without a word looks like one that is quiet.

const patienceMs = 5000;
/** A connection on which nothing at all has come for so long is tried, and given up where no answer comes. */
const silentMs = 30000;

export class ServerWatch {
  /** `ask()`: something that is answered, if by a refusal. `changed(text, isGood)` as the connection's. */
  constructor(connection, ask, changed) {
    Object.assign(this, { connection, ask, changed });
    this.periodMs = 0;
    this.isLate = false;
    this.timer = setInterval(() => this.look(), 1000);
  }

  /** A status has come: they come evenly. */
  heard(now = performance.now()) {
    if (this.lastHeard !== undefined) this.periodMs = Math.min(now - this.lastHeard, 60000);
    this.lastHeard = now;
    if (this.isLate) this.changed("connected", true);
    this.isLate = false;
  }

  look(now = performance.now()) {
    if (!this.connection.isOpen) return;
    const age = now - (this.lastHeard ?? now);
    if (age > Math.max(patienceMs, 3 * this.periodMs)) {
      this.isLate = true;
      this.changed(`no word from the server for ${Math.round(age / 1000)} s`, false);
    }
    if (this.connection.quietMs > silentMs) this.#try();
  }

  async #try() {
    if (this.isTrying) return;
    this.isTrying = true;
    await this.ask().catch(() => {});
    this.isTrying = false;
    if (this.connection.isOpen && this.connection.quietMs > silentMs) this.connection.reopen();
  }
}
