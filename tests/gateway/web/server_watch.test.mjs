// When the page says that the server is silent, and gives up a connection, by a clock of its own.
import assert from "node:assert/strict";
import test from "node:test";
import { ServerWatch } from "../../../clients/web/src/server_watch.js";

/** A watch of a connection on which nothing has come for `quietMs`. */
function watch(quietMs, ask = async () => {}) {
  const said = [];
  const connection = { isOpen: true, quietMs, reopened: 0, reopen() { ++this.reopened; } };
  const watched = new ServerWatch(connection, ask, (text, isGood) => said.push([text, isGood]));
  clearInterval(watched.timer);
  return { watched, connection, said };
}
const settled = () => new Promise((resolve) => setTimeout(resolve, 0));

test("a server that stops sending its status is said to be silent, until it sends one", () => {
  const { watched, said } = watch(0);
  for (const now of [0, 1000, 2000]) watched.heard(now);
  watched.look(6000);
  assert.deepEqual(said, []);
  watched.look(9000);
  assert.deepEqual(said.at(-1), ["no word from the server for 7 s", false]);
  watched.heard(10000);
  assert.deepEqual(said.at(-1), ["connected", true]);
});

test("a server that sends it seldom is waited for as long", () => {
  const { watched, said } = watch(0);
  for (const now of [0, 10000]) watched.heard(now);
  watched.look(35000);
  assert.deepEqual(said, []);
  watched.look(41000);
  assert.equal(said.length, 1);
});

test("before the first status, and without a connection, nothing is said", () => {
  const { watched, connection, said } = watch(60000);
  connection.isOpen = false;
  watched.heard(0);
  watched.look(60000);
  assert.deepEqual(said, []);
  assert.equal(connection.reopened, 0);
});

test("a silent connection is given up only where nobody answers", async () => {
  const dead = watch(40000, async () => { throw new Error("did not answer"); });
  dead.watched.look(0);
  await settled();
  assert.equal(dead.connection.reopened, 1);
  const alive = watch(40000);
  alive.watched.ask = async () => { alive.connection.quietMs = 0; };
  alive.watched.look(0);
  await settled();
  assert.equal(alive.connection.reopened, 0);
});
