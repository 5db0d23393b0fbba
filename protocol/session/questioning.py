"""Ask a session's questionnaires: after the blocks they belong to, and at the end."""

from visavis.lab.errors import UsageError
from visavis.protocol.plan.experiment import Respondent
from visavis.protocol.plan.questionnaires import Question, Questionnaire, read_answer
from visavis.protocol.plan.session_plan import Block, name_after_block
from visavis.protocol.session.frame_loop import FrameLoop
from visavis.protocol.session.session_setup import SessionSetup

MAX_ASKED = 3
"""How often a question is asked when the answer is not one of the possible ones."""


class Questioning:
    """Ask a respondent what was not answered before an interruption; record the answers."""

    def __init__(self, setup: SessionSetup, loop: FrameLoop, respondent: Respondent) -> None:
        self._setup = setup
        self._loop = loop
        self._respondent = respondent
        self._recorder = setup.recorder

    def is_due(self, block: Block) -> bool:
        """Tell whether questions that belong to the end of a block are left."""
        return bool(self._remaining_questionnaires(block))

    def ask_after(self, block: Block) -> None:
        """Ask what belongs to the end of a block, under names such as "presence@2"."""
        self._loop.show_scene(self._setup.experiment.blank(None))
        for questionnaire in self._remaining_questionnaires(block):
            self._ask_questionnaire(questionnaire, name_after_block(questionnaire.name, block))

    def ask_at_end(self) -> None:
        """Ask what belongs to the session's end."""
        self._loop.show_scene(self._setup.experiment.blank(None))
        of_blocks = {name for block in self._setup.plan.blocks for name in block.questionnaires}
        for questionnaire in self._setup.questionnaires:
            if questionnaire.name not in {
                *self._setup.progress.complete_questionnaires,
                *of_blocks,
            }:
                self._ask_questionnaire(questionnaire, questionnaire.name)

    def _remaining_questionnaires(self, block: Block) -> list[Questionnaire]:
        answered_names = self._setup.progress.complete_questionnaires
        return [
            q
            for q in self._setup.questionnaires
            if q.name in block.questionnaires
            and name_after_block(q.name, block) not in answered_names
        ]

    def _ask_questionnaire(self, questionnaire: Questionnaire, name: str) -> None:
        for question in questionnaire.questions():
            if (name, question.question_id) in self._setup.progress.answers:
                continue
            answer = self._ask(question)
            wording_fields = {}
            if questionnaire.wording:
                wording_fields = {"said": answer, "language": questionnaire.language}
                if question.options and answer is not None:  # a label of this wording only
                    answer = str(read_answer(question, answer))
            self._recorder.event(
                "answer",
                self._loop.t_ns,
                questionnaire=name,
                question=question.question_id,
                answer=answer,
                **wording_fields,
            )
        self._recorder.event("questionnaire_complete", self._loop.t_ns, questionnaire=name)
        self._recorder.checkpoint(timeout_s=5.0)

    def _ask(self, question: Question) -> str | None:
        prompt = question.prompt
        for _ in range(MAX_ASKED):
            answer = self._respondent.answer(question.question_id, prompt, question.options)
            try:
                read_answer(question, answer)
            except UsageError as refusal:
                prompt = f"{question.prompt}\n({refusal}; Enter leaves it out)"
            else:
                return answer
        return None
