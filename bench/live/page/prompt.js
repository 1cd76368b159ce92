// The question to a person: its text as it is, a button for each answer, a line for any other; and who answers.

import { element } from "./told.js";

const $ = (id) => document.getElementById(id);
const NAME = "levbench-name";

export function who() {
  return $("who").value.trim();
}

export function keepName() {
  try {
    $("who").value = localStorage.getItem(NAME) || "";
    $("who").addEventListener("change", () => localStorage.setItem(NAME, who()));
  } catch {
    // storage is switched off
  }
}

/** `send(id, answer)` posts; `changed(open)` hears whether a question stands. */
export function promptView(send, changed) {
  let open = null;
  let sending = false;
  let typing = false; // when the connection came anew
  const busy = (is) => {
    sending = is;
    for (const node of $("prompt").querySelectorAll("button, #answer")) node.disabled = is;
  };
  const refuse = (text) => {
    $("refused").textContent = text;
    $("refused").hidden = !text;
  };
  const close = () => {
    open = null;
    busy(false);
    $("prompt").hidden = true;
    changed(false);
  };
  const answer = async (text) => {
    if (!open || sending) return;
    const { id } = open;
    refuse("");
    busy(true);
    const { ok, status, reply } = await send(id, text);
    if (open?.id !== id) return; // answered meanwhile, here or elsewhere
    busy(false);
    if (status === 409) refuse(`It was answered already${reply.by ? ` by ${reply.by}` : ""}.`);
    else if (!ok) refuse(status ? `The run did not take the answer (${status}). ${reply.error || ""}` : "The answer did not get through. Try again, or answer at the terminal.");
    else if (reply.accepted === false) refuse(`It was answered already${reply.by ? ` by ${reply.by}` : ""}.`);
  };
  $("free").addEventListener("submit", (event) => {
    event.preventDefault();
    answer($("answer").value);
  });
  return {
    show(prompt) {
      const same = open?.id === prompt.id;
      open = prompt;
      busy(false);
      $("answered").hidden = true;
      $("prompt").hidden = false;
      if (same) { // a reconnection: what is being typed stays
        changed(true);
        if (typing) $("answer").focus();
        return;
      }
      refuse("");
      $("question").textContent = prompt.question;
      $("choices").replaceChildren(...(prompt.choices || []).map((choice, k) => {
        const button = element("button", k ? "" : "first", choice.label);
        button.type = "button";
        button.addEventListener("click", () => answer(choice.answer));
        return button;
      }));
      $("free").hidden = !prompt.free;
      $("answer").value = "";
      $("hint").textContent = prompt.hint || "Another answer";
      changed(true);
      if (!document.activeElement?.matches("input, select")) $("prompt").focus();
    },
    answered({ id, answer: text, by }) {
      if (open && open.id !== id) return;
      close();
      const said = text === "" ? "Answered: done" : `Answered: “${text}”`;
      $("answered").textContent = typeof text === "string" ? `${said}${by ? ` (${by})` : ""}.` : "The question was taken back.";
      $("answered").hidden = false;
    },
    /** The connection is made anew: if the question still stands it comes again. */
    heardHello() {
      typing = document.activeElement === $("answer");
      $("prompt").hidden = true;
      changed(false);
    },
    close,
  };
}
