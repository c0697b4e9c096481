// A choice is answered at once: right or not, and why. Works from the keyboard, since choices are radio buttons.

function answer(question, chosen) {
  const right = chosen.dataset.right === "yes";
  question.dataset.answered = right ? "right" : "wrong";
  for (const other of question.querySelectorAll(".quiz-answer")) {
    other.classList.toggle("chosen", other === chosen);
  }
  const because = [...chosen.querySelector(".quiz-because").childNodes].map((node) => node.cloneNode(true));
  const verdict = document.createElement("strong");
  verdict.textContent = right ? "✓ Right. " : "✗ Not right. ";
  question.querySelector(".quiz-said").replaceChildren(verdict, ...because);
}

function score(quiz) {
  const questions = [...quiz.querySelectorAll(".quiz-question")];
  const right = questions.filter((question) => question.dataset.answered === "right").length;
  quiz.querySelector(".quiz-score").textContent = `${right} of ${questions.length} answered right`;
}

document.addEventListener("change", (event) => {
  const chosen = event.target.closest(".quiz-answer");
  if (!chosen) return;
  answer(chosen.closest(".quiz-question"), chosen);
  score(chosen.closest(".quiz"));
});
