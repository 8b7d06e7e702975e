// The demo's page: the problem as PDDL is the one truth; every edit writes it anew and has the oracle read it.
"use strict";

const $ = (id) => document.getElementById(id);
const DECODINGS = {
  greedy: "The likeliest token each time, no help.",
  sample: "Drawn from the likeliest tokens, no help.",
  beam: "The likeliest whole text of several, no help.",
  "best-of-k": "Several samples; the model chooses among them.",
  masked: "The oracle allows only what can be executed, and writes the states.",
  search: "The oracle's successors, the model's probability as the guide.",
};
let parts = null;
let about = null;
let number = 0;
let reading = 0;

function element(name, text = "", kind = "") {
  const made = document.createElement(name);
  made.textContent = text;
  made.className = kind;
  return made;
}

async function ask(path, body) {
  const options = body && { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
  return (await fetch(path, options)).json();
}

function texts() {
  return { domain: $("domain-text").value, problem: $("problem-text").value };
}

function complain(message) {
  $("error").textContent = message;
  $("error").hidden = !message;
}

async function read() {
  const turn = ++reading;
  clear();
  const found = await ask("/read", texts());
  if (turn !== reading) return;
  complain(found.error || "");
  $("solve").disabled = Boolean(found.error);
  if (found.error) {
    $("texts").open = true;
    return;
  }
  parts = found;
  show();
}

function show() {
  $("parts").hidden = !parts.plain;
  $("objects").replaceChildren(
    ...parts.constants.map(([name, type]) => chip(name, type)),
    ...parts.objects.map(([name, type], at) => chip(name, type, () => edit(() => drop(at)))),
  );
  for (const where of ["init", "goal"]) {
    $(where).replaceChildren(...parts[where].map((atom, at) => chip(atom, "", () => edit(() => parts[where].splice(at, 1)))));
  }
  fill($("object-type"), parts.types);
  document.querySelectorAll("form[data-add]").forEach(atomForm);
}

function chip(text, note, remove) {
  const made = element("span", text, remove ? "chip" : "chip fixed");
  if (note) made.append(element("small", note));
  if (remove) {
    const button = element("button", "×");
    button.type = "button";
    button.ariaLabel = `remove ${text}`;
    button.onclick = remove;
    made.append(button);
  }
  return made;
}

function fill(select, values, chosen) {
  const before = chosen ?? select.value;
  select.replaceChildren(...values.map((value) => element("option", value)));
  if (values.includes(before)) select.value = before;
}

// A form that adds an atom: a predicate, and an object for each of its parameters.
function atomForm(form) {
  const where = form.dataset.add;
  const predicate = document.createElement("select");
  predicate.ariaLabel = "predicate";
  fill(predicate, parts.predicates.map(([name]) => name));
  const chosen = form.firstChild && form.firstChild.value;
  if (chosen) predicate.value = chosen;
  const spaces = element("span", "", "row");
  const objects = [...parts.constants, ...parts.objects].map(([name]) => name);
  const lay = () => {
    const types = parts.predicates.find(([name]) => name === predicate.value)?.[1] ?? [];
    spaces.replaceChildren(...types.map((type) => {
      const select = document.createElement("select");
      select.ariaLabel = type;
      select.title = type;
      fill(select, objects);
      return select;
    }));
  };
  predicate.onchange = lay;
  lay();
  form.replaceChildren(predicate, spaces, element("button", "add"));
  form.onsubmit = (event) => {
    event.preventDefault();
    const atom = `(${[predicate.value, ...[...spaces.children].map((select) => select.value)].join(" ")})`;
    edit(() => parts[where].includes(atom) || parts[where].push(atom));
  };
}

function drop(at) {
  const [name] = parts.objects.splice(at, 1)[0];
  const without = (atom) => !atom.replace(/[()]/g, " ").split(/\s+/).slice(1).includes(name);
  parts.init = parts.init.filter(without);
  parts.goal = parts.goal.filter(without);
}

function edit(change) {
  change();
  const list = (items) => items.map((item) => `\n    ${item}`).join("");
  const objects = parts.objects.map(([name, type]) => `${name} - ${type}`);
  $("problem-text").value = `(define (problem ${parts.name})\n  (:domain ${parts.domain})\n  (:objects${list(objects)})\n`
    + `  (:init${list(parts.init)})\n  (:goal (and ${parts.goal.join(" ")})))\n`;
  read();
}

async function example() {
  const name = $("domain").value;
  const found = about.domains.find((domain) => domain.name === name);
  if (!found) return;
  $("domain-text").value = found.text;
  const made = await ask(`/example?domain=${encodeURIComponent(name)}&number=${number}`);
  if (made.error) return complain(made.error);
  $("problem-text").value = made.problem;
  clear();
  await read();
}

function clear() {
  $("plan").replaceChildren();
  $("verdict").replaceChildren();
  $("oracle").replaceChildren();
}

async function solve() {
  clear();
  complain("");
  $("solve").disabled = true;
  $("verdict").textContent = "writing …";
  try {
    const answer = await fetch("/solve", {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ ...texts(), decode: $("decode").value }),
    });
    const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
    let rest = "";
    for (let part = await reader.read(); !part.done; part = await reader.read()) {
      const lines = (rest + part.value).split("\n");
      rest = lines.pop();
      lines.forEach((line) => tell(JSON.parse(line)));
    }
  } catch (error) {
    complain(`the demo does not answer: ${error.message}`);
  }
  if ($("verdict").textContent === "writing …") $("verdict").textContent = "";
  $("solve").disabled = false;
}

function tell(event) {
  if (event.event === "steps") $("plan").replaceChildren(...event.steps.map((step) => line(step)));
  if (event.event === "answer") answer(event);
  if (event.event === "oracle") oracle(event);
  if (event.event === "error" || event.error) complain(event.error);
}

function line(step, number, at) {
  const made = element("li", "", at && number === at ? "wrong" : at && number > at ? "after" : "");
  made.append(element("code", step.operator));
  if (step.probability !== undefined) {
    const likely = element("span", "", "likely");
    const bar = element("span", "", "bar");
    const inner = bar.appendChild(document.createElement("i"));
    inner.style.width = `${100 * step.probability}%`;
    likely.append(bar, `${(100 * step.probability).toFixed(1)} %`);
    made.append(likely);
  }
  const changes = element("div", "", "changes");
  changes.append(...step.added.map((atom) => element("span", `+ ${atom}`, "added")));
  changes.append(...step.removed.map((atom) => element("span", atom, "removed")));
  made.append(changes);
  if (step.applies && step.state_right === false) made.append(element("div", "this is not the true state", "lie"));
  return made;
}

function answer(event) {
  $("plan").replaceChildren(...event.steps.map((step, at) => line(step, at + 1, event.step)));
  const verdict = element("span", event.valid ? "✓ valid" : "✗ not valid", event.valid ? "good" : "bad");
  const time = `${event.tokens} tokens, ${event.seconds.toFixed(1)} s`;
  const mask = event.removed === null ? "" : `; the mask removed ${(100 * event.removed).toFixed(1)} % of the probability`;
  $("verdict").replaceChildren(verdict, ` ${event.reason}`, element("div", time + mask, "faint"));
}

function oracle(event) {
  if (!event.shortest) {
    $("oracle").replaceChildren(element("p", event.note, "faint"));
    return;
  }
  const total = event.open[0];
  const many = `${total} plan${total === "1" ? "" : "s"} of at most ${event.max_steps} steps; a shortest one:`;
  const list = document.createElement("ol");
  list.append(...event.shortest.map((operator) => { const li = document.createElement("li"); li.append(element("code", operator)); return li; }));
  const open = `Plans still open after each step of the model's: ${event.open.join(" → ")}`;
  $("oracle").replaceChildren(element("p", many), list, element("p", open, "faint"));
}

function explain() {
  $("about-decode").textContent = DECODINGS[$("decode").value] || "";
}

async function start() {
  about = await ask("/about");
  const trained = about.trained.length ? `trained on ${about.trained.join(", ")}` : "spells names as they are";
  $("model").textContent = `${about.model}, ${trained}. Every plan is checked against the problem's PDDL.`;
  const names = about.domains.map((domain) => domain.name);
  fill($("domain"), names, about.trained[0]);
  for (const option of $("domain").options) {
    if (about.trained.length && !about.trained.includes(option.value)) option.label = `${option.value} (not trained on)`;
  }
  fill($("decode"), about.decodes);
  explain();
  $("decode").onchange = explain;
  $("domain").onchange = () => { number = 0; example(); };
  $("another").onclick = () => { number += 1; example(); };
  $("solve").onclick = solve;
  $("add-object").onsubmit = (event) => {
    event.preventDefault();
    const name = $("object-name").value.trim();
    if (name) edit(() => parts.objects.push([name, $("object-type").value]));
    $("object-name").value = "";
  };
  let pause = 0;
  for (const id of ["domain-text", "problem-text"]) {
    $(id).oninput = () => { clearTimeout(pause); pause = setTimeout(read, 300); };
  }
  document.querySelectorAll("input[type=file]").forEach((input) => {
    input.onchange = async () => { $(input.dataset.into).value = await input.files[0].text(); read(); };
  });
  await example();
  document.body.dataset.ready = "yes";
}

start().catch((error) => complain(`the demo does not answer: ${error.message}`));
